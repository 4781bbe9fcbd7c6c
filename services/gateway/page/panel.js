// What is known, in words: fills the elements of the page, and only those that changed.

const LOOKS = { moving: "busy", succeeded: "good", failed: "bad", cancelled: "warn" };
const STUCK = { move_stucked: "Blocked by an obstacle.", target_spin_stucked: "No room to turn to the heading." };
const LOADS = { under_rack: "warn", carrying: "busy", docked: "good" };
const TOAST = 8000; // ms
const EXPLAINED = new Set(["failed", "waiting", "stuck", "slow"]);

export const at = (id) => document.getElementById(id);
export const show = (id, text) => { if (at(id).textContent !== text) at(id).textContent = text; };
export const hide = (id, hidden) => { if (at(id).hidden !== hidden) at(id).hidden = hidden; };
const dress = (id, look) => { if (at(id).className !== look) at(id).className = look; };
export const badge = (id, text, look = "") => { show(id, text); dress(id, `badge ${look}`.trim()); };

export const number = (value, digits) => (Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value).toFixed(digits);
const degrees = (radians) => `${number((radians * 180) / Math.PI, 0)}°`;
const place = ({ pos, ori }) => `${number(pos[0], 2)}, ${number(pos[1], 2)} m · ${degrees(ori)}`;
const words = (name) => name.replaceAll("_", " ");

export function showState(known) {
  const { planning, pose, motion, slam, wheels, jack, load, battery, alerts } = known;
  if (planning) showMove(known);
  if (pose) show("pose", place(pose));
  if (motion) show("speed", `${number(motion.linear_velocity, 2)} m/s · ${degrees(motion.angular_velocity)}/s`);
  if (slam) {
    show("slam", `${slam.reliable ? "yes" : "no"} (${slam.position_quality} of 10)`);
    dress("slam", slam.reliable ? "" : "bad");
  }
  if (wheels) showWheels(wheels);
  if (jack) show("jack", `${words(jack.state)} · ${number(jack.progress * 100, 0)} % up · ${number(jack.weight, 0)} kg`);
  if (load) badge("load", words(load.state), LOADS[load.state]);
  if (battery) {
    show("battery", `${number(battery.percentage * 100, 0)} % · ${battery.power_supply_status}`);
    at("charge").value = battery.percentage;
  }
  if (known.lifts) showLifts(known.lifts);
  if (alerts) fill("alerts", alerts.alerts.map(({ code, level, msg }) => row([`${code}: ${msg}`], level)));
}

function showMove({ planning, longest, moves, explained }) {
  const moving = planning.move_state === "moving";
  badge("move-state", planning.move_state, LOOKS[planning.move_state]);
  show("move-id", planning.action_id ? `#${planning.action_id}` : "");
  show("move-type", words(planning.action_type));
  show("move-target", planning.target_poses.length ? place(planning.target_poses[0]) : "–");
  show("move-left", moving ? `${number(planning.remaining_distance, 2)} m` : "–");
  at("move-progress").value = moving
    ? (longest ? 1 - planning.remaining_distance / longest : 0) : Number(planning.move_state === "succeeded");
  const failed = planning.move_state === "failed";
  const record = moves?.find(({ id }) => id === planning.action_id);
  const note = failed ? reason(record ?? planning) : moving ? hindrance(planning) : "";
  show("move-note", note);
  dress("move-note", failed ? "" : "warn");
  hide("move-note", !note);
  showExplanation(explained?.id === planning.action_id ? explained : null);
  at("cancel").disabled = at("pause").disabled = !moving;
  show("pause", planning.paused ? "Resume" : "Pause");
}

// The cause in words and what to do, where there is something to explain.
function showExplanation(explained) {
  const told = explained && EXPLAINED.has(explained.verdict);
  show("move-why", told ? `${explained.cause}.` : "");
  show("move-advice", told && explained.advice ? `To do: ${explained.advice}.` : "");
  hide("move-why", !told);
  hide("move-advice", !(told && explained.advice));
  hide("move-record", !told);
}

// Why a move does not go on, or an empty text.
function hindrance({ stuck_state, message }) {
  return message || (stuck_state === "none" ? "" : (STUCK[stuck_state] ?? words(stuck_state)));
}

// "15 move timeout: blocked for 30 s" of a move's record, or of a planning state, which has no message.
function reason({ fail_reason, fail_reason_str, fail_message }) {
  const name = words(fail_reason_str.replace("MoveFailReason::", "").split(" - ")[0]);
  return `${fail_reason} ${name}${fail_message ? `: ${fail_message}` : ""}`;
}

function showLifts({ lifts }) {
  hide("lifts-card", !lifts.length);
  fill("lifts", lifts.map((lift) => {
    const { name, floor, target, moving, door, blocked, holder } = lift;
    const where = moving ? `${floor} to ${target}` : `${floor} · door ${door}${blocked ? ", blocked" : ""}`;
    return row([text(name), small(`${where} · ${holder ? `held by ${holder}` : "free"}`)]);
  }));
}

function showWheels({ control_mode, emergency_stop_pressed: pressed }) {
  for (const button of at("modes").children) {
    button.classList.toggle("chosen", button.dataset.mode === control_mode);
    button.setAttribute("aria-pressed", button.dataset.mode === control_mode);
  }
  hide("pad", control_mode !== "remote");
  hide("stopped", !pressed);
  at("stop").disabled = false;
  dress("stop", pressed ? "stop pressed" : "stop");
  show("stop", pressed ? "Release the stop" : "Emergency stop");
}

export function showLink(connected) {
  badge("link", connected ? "live" : "no connection", connected ? "good" : "bad");
  document.body.classList.toggle("offline", !connected);
}

export function showHealth(health) {
  badge("health", health?.status ?? "unknown", health?.status === "up" ? "good" : "bad");
  if (!health) return;
  fill("services", health.services.map(({ robot, service, status, restarts }) =>
    row([light(status), text(`${robot}/${service}`), small(status + (restarts ? ` · came back ${restarts}×` : ""))])));
}

export function showMoves(moves) {
  if (!moves.length) return;
  fill("moves", moves.map((move) => {
    const seconds = move.last_modified_time - move.create_time;
    const end = { moving: "moving", failed: reason(move) }[move.state] ?? `${move.state} · ${seconds} s`;
    const item = row([light(LOOKS[move.state] ?? ""), text(`#${move.id} ${words(move.type)}`), small(end)]);
    item.title = end;
    return item;
  }));
}

export function showRobot({ device }) {
  show("robot", `${device.name} · ${device.model}`);
}

export function showCursor(point) {
  show("cursor", point ? `${number(point[0], 2)}, ${number(point[1], 2)} m` : "");
}

let toast = 0;
export function complain(what) {
  show("toast-text", what);
  hide("toast", !what);
  clearTimeout(toast);
  if (what) toast = setTimeout(complain, TOAST, "");
}

export function fill(id, rows) {
  const list = at(id);
  if (list.children.length === rows.length && rows.every((item, i) => item.isEqualNode(list.children[i]))) return;
  list.replaceChildren(...rows);
}

export function row(parts, look = "") {
  const item = document.createElement("li");
  item.append(...parts);
  if (look) item.className = look;
  return item;
}

function light(look) {
  const lamp = document.createElement("i");
  lamp.className = look;
  return lamp;
}

export function text(words, kind = "span") {
  const part = document.createElement(kind);
  part.textContent = words;
  return part;
}

function small(words) {
  const note = text(words, "small");
  note.className = "quiet";
  return note;
}
