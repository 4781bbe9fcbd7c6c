// What the WebSocket tells is kept in `known` and drawn; clicks become moves.
import { View, draw } from "./draw.js";

const TOPICS = {
  "/map": "map", "/map/info": "info", "/tracked_pose": "pose", "/path": "path", "/planning_state": "planning",
  "/scan_matched_points2": "scan", "/robot_model": "model", "/motion_metrics": "motion", "/slam/state": "slam",
  "/battery_state": "battery", "/wheel_state": "wheels", "/jack_state": "jack", "/alerts": "alerts",
};
const MOVE_LOOKS = { moving: "busy", succeeded: "good", failed: "bad", cancelled: "warn" };
const secret = new URLSearchParams(location.search).get("secret");

const at = (id) => document.getElementById(id);
const show = (id, text) => { if (at(id).textContent !== text) at(id).textContent = text; };
const badge = (id, text, look = "") => { show(id, text); at(id).className = `badge ${look}`; };
const metres = (value) => `${value.toFixed(2)} m`;
const degrees = (radians) => `${(radians * 180 / Math.PI).toFixed(0)}°`;
const place = (pose) => `${pose.pos[0].toFixed(2)}, ${pose.pos[1].toFixed(2)} · ${degrees(pose.ori)}`;

const view = new View(at("map"));
const known = {};
let aim = null;
let redraw = false;

function changed() {
  if (redraw) return;
  redraw = true;
  requestAnimationFrame(() => { redraw = false; draw(view, known, aim); tell(); });
}

function connect() {
  const query = secret ? `?secret=${encodeURIComponent(secret)}` : "";
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws/v2/topics${query}`);
  socket.onopen = () => {
    badge("link", "live", "good");
    socket.send(JSON.stringify({ enable_topic: Object.keys(TOPICS) }));
  };
  socket.onmessage = ({ data }) => hear(JSON.parse(data));
  socket.onclose = () => { badge("link", "no connection", "bad"); setTimeout(connect, 1000); };
}

function hear(message) {
  const name = TOPICS[message.topic];
  if (!name) return;
  known[name] = message;
  if (name === "map") loadMap(message);
  changed();
}

function loadMap(message) {
  const image = new Image();
  image.onload = () => { if (known.map === message) { known.image = image; changed(); } };
  image.src = `data:image/png;base64,${message.data}`;
}

function tell() {
  const { planning, pose, motion, slam, wheels, jack, battery, alerts } = known;
  if (planning) tellMove(planning);
  if (pose) show("pose", place(pose));
  if (motion) show("speed", `${motion.linear_velocity.toFixed(2)} m/s · ${degrees(motion.angular_velocity)}/s`);
  if (slam) show("slam", slam.reliable ? `yes (${slam.position_quality}/10)` : `no (${slam.position_quality}/10)`);
  if (wheels) show("mode", wheels.control_mode + (wheels.emergency_stop_pressed ? " · EMERGENCY STOP" : ""));
  if (jack) show("jack", `${jack.state} · ${(jack.progress * 100).toFixed(0)} %`);
  if (battery) {
    show("battery", `${(battery.percentage * 100).toFixed(0)} % · ${battery.power_supply_status}`);
    at("charge").value = battery.percentage;
  }
  if (alerts) list("alerts", alerts.alerts.map(({ code, level, msg }) => [level, `${code} ${msg}`]));
}

function tellMove(planning) {
  const moving = planning.move_state === "moving";
  badge("move-state", planning.move_state, MOVE_LOOKS[planning.move_state]);
  show("move-id", planning.action_id ? `#${planning.action_id}` : "");
  show("move-type", planning.action_type);
  show("move-target", planning.target_poses.length ? place(planning.target_poses[0]) : "–");
  show("move-left", moving ? metres(planning.remaining_distance) : "–");
  const reason = planning.move_state === "failed" ? `${planning.fail_reason} ${planning.fail_reason_str}` : "";
  show("move-note", moving && planning.stuck_state !== "none" ? "blocked" : reason);
  at("cancel").disabled = !moving;
}

function list(id, rows) {
  at(id).replaceChildren(...rows.map(([look, text]) => {
    const row = document.createElement("li");
    row.className = look;
    row.textContent = text;
    return row;
  }));
}

async function ask(method, path, body) {
  const headers = { "Content-Type": "application/json", Accept: "application/json" };
  if (secret) headers.Secret = secret;
  const response = await fetch(path, { method, headers, body: body && JSON.stringify(body) });
  const answer = await response.json().catch(() => null);
  return { ok: response.ok, status: response.status, answer };
}

async function order(method, path, body) {
  try {
    const { ok, status, answer } = await ask(method, path, body);
    show("message", ok ? "" : `${status}: ${answer?.detail ?? answer ?? "refused"}`);
  } catch {
    show("message", "the gateway does not answer");
  }
}

async function health() {
  try {
    const { answer } = await ask("GET", "/healthz");
    badge("health", answer.status, answer.status === "up" ? "good" : "bad");
    at("services").replaceChildren(...answer.services.map((row) => {
      const item = document.createElement("li");
      const light = document.createElement("i");
      light.className = row.status;
      const note = document.createElement("span");
      note.className = "quiet";
      note.textContent = row.status + (row.restarts ? ` · restarted ${row.restarts}×` : "");
      item.append(light, `${row.robot}/${row.service}`, note);
      return item;
    }));
  } catch {
    badge("health", "unknown", "bad");
  }
}

function spot(event) {
  const box = view.canvas.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}

let pressed = null;
let panning = null;
view.canvas.addEventListener("pointerdown", (event) => {
  view.canvas.setPointerCapture(event.pointerId);
  if (event.button === 0) { pressed = spot(event); aim = { pos: view.toMap(...pressed) }; }
  else { panning = spot(event); }
  changed();
});
view.canvas.addEventListener("pointermove", (event) => {
  const now = spot(event);
  if (panning) { view.pan(now[0] - panning[0], now[1] - panning[1]); panning = now; changed(); }
  if (!pressed) return;
  const far = Math.hypot(now[0] - pressed[0], now[1] - pressed[1]) > 12;
  aim.ori = far ? Math.atan2(pressed[1] - now[1], now[0] - pressed[0]) : undefined;
  changed();
});
view.canvas.addEventListener("pointerup", () => {
  panning = null;
  if (!pressed) return;
  const move = { creator: "gateway page", type: "standard", target_x: aim.pos[0], target_y: aim.pos[1] };
  if (aim.ori !== undefined) move.target_ori = aim.ori;
  pressed = aim = null;
  order("POST", "/chassis/moves", move);
  changed();
});
view.canvas.addEventListener("pointercancel", () => { pressed = aim = panning = null; changed(); });
view.canvas.addEventListener("contextmenu", (event) => event.preventDefault());
view.canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  view.zoom(...spot(event), Math.exp(-event.deltaY / 500));
  changed();
}, { passive: false });
at("cancel").addEventListener("click", () => order("PATCH", "/chassis/moves/current", { state: "cancelled" }));
new ResizeObserver(changed).observe(view.canvas);

ask("GET", "/device/info/brief").then(({ answer }) => show("robot", `${answer.device.name} · ${answer.device.model}`)).catch(() => {});
setInterval(health, 2000);
health();
connect();
changed();
