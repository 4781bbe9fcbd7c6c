// Messages from and requests to the gateway. Nothing here changes the document.

export const TOPICS = {
  "/map": "map", "/map/info": "info", "/tracked_pose": "pose", "/path": "path", "/planning_state": "planning",
  "/scan_matched_points2": "scan", "/robot_model": "model", "/motion_metrics": "motion", "/slam/state": "slam",
  "/battery_state": "battery", "/wheel_state": "wheels", "/jack_state": "jack", "/alerts": "alerts",
  "/load_state": "load", "/map_rack_states": "rackStates", "/detected_rack": "detected", "/seen_racks": "seenRacks",
  "/lift_states": "lifts",
};
const RECONNECT = 1000; // ms
const KEPT = 60_000; // ms that a file is kept for the browser to save it
const NO_ANSWER = "The gateway does not answer.";
const secret = new URLSearchParams(location.search).get("secret");

// The URL of a WebSocket of the gateway.
function socketUrl(path) {
  const query = secret ? `?secret=${encodeURIComponent(secret)}` : "";
  return `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}${query}`;
}

// A WebSocket that comes back by itself, and sends `hello` first each time. `onMessage` gets every frame, `onLink` whether
// it is connected.
export class Wire {
  constructor(path, hello, onMessage, onLink) {
    Object.assign(this, { path, hello, onMessage, onLink });
    this.connect();
  }

  connect() {
    this.socket = new WebSocket(socketUrl(this.path));
    this.socket.onopen = () => {
      this.onLink(true);
      this.send(this.hello);
    };
    this.socket.onmessage = ({ data }) => this.onMessage(JSON.parse(data));
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
    return ok ? "" : refusal(status, answer);
  } catch {
    return NO_ANSWER;
  }
}

// Saves a file of the gateway, as a link would, but with the secret, and with the reason where there is no file.
// Resolves as `order` does.
export async function save(path, name) {
  try {
    const response = await fetch(path, { headers: secret ? { Secret: secret } : {} });
    if (!response.ok) return refusal(response.status, await response.json().catch(() => null));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(await response.blob());
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), KEPT);
    return "";
  } catch {
    return NO_ANSWER;
  }
}

function refusal(status, answer) {
  const why = Array.isArray(answer) ? answer.join("; ") : answer?.detail;
  return `Refused (${status}): ${why ?? "no reason was given"}`;
}
