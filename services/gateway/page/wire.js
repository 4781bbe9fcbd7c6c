// Messages from and requests to the gateway. Nothing here touches the document.

export const TOPICS = {
  "/map": "map", "/map/info": "info", "/tracked_pose": "pose", "/path": "path", "/planning_state": "planning",
  "/scan_matched_points2": "scan", "/robot_model": "model", "/motion_metrics": "motion", "/slam/state": "slam",
  "/battery_state": "battery", "/wheel_state": "wheels", "/jack_state": "jack", "/alerts": "alerts",
  "/load_state": "load", "/map_rack_states": "rackStates", "/detected_rack": "detected", "/seen_racks": "seenRacks",
  "/lift_states": "lifts",
};
const RECONNECT = 1000; // ms
const secret = new URLSearchParams(location.search).get("secret");

// A WebSocket that comes back by itself. `onMessage` gets every frame with a topic, `onLink` whether it is connected.
export class Wire {
  constructor(onMessage, onLink) {
    this.onMessage = onMessage;
    this.onLink = onLink;
    this.connect();
  }

  connect() {
    const query = secret ? `?secret=${encodeURIComponent(secret)}` : "";
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/ws/v2/topics${query}`);
    this.socket.onopen = () => {
      this.onLink(true);
      this.send({ enable_topic: Object.keys(TOPICS) });
    };
    this.socket.onmessage = ({ data }) => {
      const message = JSON.parse(data);
      if (message.topic) this.onMessage(message);
    };
    this.socket.onclose = () => {
      this.onLink(false);
      setTimeout(() => this.connect(), RECONNECT);
    };
  }

  send(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}

// An HTTP request. Resolves to {ok, status, answer}; rejects when nobody answers.
export async function ask(method, path, body) {
  const headers = { Accept: "application/json" };
  if (body) headers["Content-Type"] = "application/json";
  if (secret) headers.Secret = secret;
  const response = await fetch(path, { method, headers, body: body && JSON.stringify(body) });
  const answer = await response.json().catch(() => null);
  return { ok: response.ok, status: response.status, answer };
}

// An order. Resolves to what went wrong, in words, or to an empty text.
export async function order(method, path, body) {
  try {
    const { ok, status, answer } = await ask(method, path, body);
    if (ok) return "";
    const why = Array.isArray(answer) ? answer.join("; ") : answer?.detail;
    return `Refused (${status}): ${why ?? "no reason was given"}`;
  } catch {
    return "The gateway does not answer.";
  }
}
