// The page: messages of the WebSocket are kept in `known` and shown; clicks become requests.
import { findArm } from "./arm.js";
import { draw, paintMap } from "./draw.js";
import { Faults } from "./faults.js";
import { Drive, listenToMap } from "./gestures.js";
import { at, complain, showState, showCursor, showHealth, showLink, showMoves, showRobot } from "./panel.js";
import { RackJobs } from "./racks.js";
import { Route } from "./route.js";
import { View } from "./view.js";
import { TOPICS, Wire, ask, order, save } from "./wire.js";

const HEALTH_PERIOD = 2000; // ms
const RETRY = 2000; // ms
const LAST_MOVES = 6;
const TRAIL_STEP = 0.05; // metres
const TRAIL_LENGTH = 2000; // points
const COLOURS = [
  "floor", "wall", "grid", "halo", "robot", "nose", "path", "trail", "scan", "aim", "label", "forbidden", "slow", "lift",
  "rack", "charger",
];

const view = new View(at("map"));
const known = { trail: [] };
const jobs = new RackJobs(command, changed);
const route = new Route(command, changed);
const faults = new Faults(command);
const arms = {};
let colours = readColours();
let aim = null;
let redraw = false;

function readColours() {
  const style = getComputedStyle(document.documentElement);
  const named = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--map-${name}`).trim()]));
  const others = { quiet: "--quiet", warn: "--warn", stopped: "--stop" };
  for (const [name, variable] of Object.entries(others)) named[name] = style.getPropertyValue(variable).trim();
  return named;
}

function changed() {
  if (redraw) return;
  redraw = true;
  requestAnimationFrame(() => {
    redraw = false;
    jobs.show(known);
    draw(view, { ...known, route, chosen: jobs.chosen?.key }, aim, colours);
    showState(known);
  });
}

function receive(message) {
  const name = TOPICS[message.topic];
  if (name) {
    const before = known[name];
    known[name] = message;
    if (name === "map") loadMap(message);
    if (name === "planning") hearPlanning(before, message);
    if (name === "pose") extendTrail(message.pos);
    if (name === "model" && !known.body) loadBody();
    if (name === "detected") known.detectedAt = Date.now();
    changed();
  } else if (message.topic === "/twist_feedback") {
    drive.answered();
  } else if (message.topic === "/error") {
    drive.answered();
    complain(message.detail);
  }
}

function hearPlanning(before, now) {
  const fresh = before?.action_id !== now.action_id;
  if (fresh && now.move_state === "moving") known.trail = [];
  known.longest = Math.max(fresh ? 0 : known.longest, now.remaining_distance);
  const ended = fresh || before.move_state !== now.move_state;
  if (ended) loadMoves();
  if (ended || before.stuck_state !== now.stuck_state || before.message !== now.message) loadExplanation(now.action_id);
}

// Why the move failed, waits or is slow.
async function loadExplanation(id) {
  const { ok, answer } = id ? await ask("GET", `/chassis/moves/${id}/explain`).catch(() => ({})) : {};
  known.explained = ok ? answer : null;
  changed();
}

function extendTrail(pos) {
  const last = known.trail.at(-1);
  if (last && Math.hypot(pos[0] - last[0], pos[1] - last[1]) < TRAIL_STEP) return;
  known.trail.push(pos);
  if (known.trail.length > TRAIL_LENGTH) known.trail.shift();
}

function loadMap(message) {
  const image = new Image();
  image.onload = () => {
    if (known.map !== message) return; // another came meanwhile
    known.image = image;
    known.painted = paintMap(image, colours);
    changed();
  };
  image.src = `data:image/png;base64,${message.data}`;
  document.documentElement.style.setProperty("--aspect", message.size.join(" / "));
}

async function loadMoves() {
  const { ok, answer } = await ask("GET", `/chassis/moves?limit=${LAST_MOVES}`).catch(() => ({}));
  if (!ok) {
    setTimeout(loadMoves, RETRY);
    return;
  }
  known.moves = answer;
  showMoves(answer);
  changed();
}

// The outline of the robot without a load; until it is known, the outline in force stands for it.
async function loadBody() {
  const { ok, answer } = await ask("GET", "/device/info").catch(() => ({}));
  if (!ok) return;
  known.body = answer.robot.footprint;
  changed();
}

async function loadHealth() {
  const { answer } = await ask("GET", "/healthz").catch(() => ({}));
  const health = answer?.services ? answer : null;
  showHealth(health);
  findArm(health, arms);
  faults.load(health);
}

async function command(method, path, body) {
  complain(await order(method, path, body));
}

function link(connected) {
  showLink(connected);
  if (!connected) return;
  for (const name of Object.keys(known)) delete known[name]; // it may be another cell by now
  known.trail = [];
  ask("GET", "/device/info/brief").then(({ ok, answer }) => ok && showRobot(answer)).catch(() => {});
}

listenToMap(view, {
  onAim: (now) => { aim = now; changed(); },
  onGo: ({ pos: [x, y], ori }) => {
    if (faults.put([x, y], ori)) return;
    if (route.add([x, y])) return;
    if (ori === undefined && jobs.choose([x, y])) {
      changed();
      return;
    }
    const move = { creator: "gateway page", type: "standard", target_x: x, target_y: y };
    command("POST", "/chassis/moves", ori === undefined ? move : { ...move, target_ori: ori });
  },
  onView: changed,
  onHover: showCursor,
});
at("zoom-in").addEventListener("click", () => { view.zoomAtCentre(1.4); changed(); });
at("zoom-out").addEventListener("click", () => { view.zoomAtCentre(1 / 1.4); changed(); });
at("zoom-fit").addEventListener("click", () => { view.touched = false; changed(); });
at("cancel").addEventListener("click", () => command("PATCH", "/chassis/moves/current", { state: "cancelled" }));
at("pause").addEventListener("click", () => {
  command("PATCH", "/chassis/moves/current", { state: known.planning?.paused ? "moving" : "paused" });
});
at("move-record").addEventListener("click", async () => {
  const { id } = known.explained;
  at("move-record").disabled = true; // it takes a second or two to be made
  complain(await save(`/chassis/moves/${id}/explain/download.rrd`, `move_${id}.rrd`));
  at("move-record").disabled = false;
});
at("charge-move").addEventListener("click", () => {
  command("POST", "/chassis/moves", { creator: "gateway page", type: "charge", charge_retry_count: 3 });
});
at("stop").addEventListener("click", () => {
  command("POST", "/services/wheel_control/set_emergency_stop", { enable: !known.wheels?.emergency_stop_pressed });
});
at("modes").addEventListener("click", ({ target }) => {
  const mode = target.dataset.mode;
  if (mode) command("POST", "/services/wheel_control/set_control_mode", { control_mode: mode });
});
at("toast-close").addEventListener("click", () => complain(""));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  colours = readColours();
  if (known.image) known.painted = paintMap(known.image, colours);
  changed();
});
new ResizeObserver(changed).observe(view.canvas);

const wire = new Wire("/ws/v2/topics", { enable_topic: Object.keys(TOPICS) }, receive, link);
const drive = new Drive(at("pad"), () => known.wheels?.control_mode === "remote", (twist) => wire.send(twist));
setInterval(loadHealth, HEALTH_PERIOD);
loadHealth();
changed();
