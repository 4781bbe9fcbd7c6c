// What can go wrong in a simulated world: choose a fault and what has it, cause it, clear it. A fault that needs a place
// waits for a click on the map. Hidden where there is no simulator.
import { at, fill, hide, row, text } from "./panel.js";
import { ask } from "./wire.js";

const SHIFT = { x: 0.1, y: 0, yaw: 0 }; // m and rad, of a rack or a charger in its own frame

export class Faults {
  constructor(order) {
    this.kinds = [];
    this.order = order;
    at("fault").addEventListener("change", () => this.showTargets());
    at("fault-cause").addEventListener("click", () => this.cause());
  }

  get chosen() {
    return this.kinds.find(({ name }) => name === at("fault").value);
  }

  cause() {
    const [target, part] = at("fault-target").value.split("#");
    const fault = { fault: at("fault").value, target, ...(part ? { part: Number(part) } : {}), active: true };
    if (this.chosen.pose === "at") this.wait(fault);
    else this.change(this.chosen.pose ? { ...fault, pose: SHIFT } : fault);
  }

  wait(fault) {
    this.waiting = fault;
    at("fault-cause").setAttribute("aria-pressed", Boolean(fault));
    at("fault-cause").textContent = fault ? "Click on the map" : "Cause it";
  }

  // A place on the map, for a fault that waits for one. False if none does.
  put([x, y], yaw = 0) {
    if (!this.waiting) return false;
    this.change({ ...this.waiting, pose: { x, y, yaw } });
    this.wait(null);
    return true;
  }

  async change(body) {
    await this.order("POST", "/world/faults", body);
  }

  // Where there is a simulator, by the services' health.
  async load(health) {
    const simulated = health?.services.some(({ service, status }) => service === "sim" && status === "up");
    if (!simulated) hide("faults", true);
    const { ok, answer } = simulated ? await ask("GET", "/world/faults").catch(() => ({})) : {};
    if (!ok) return;
    hide("faults", false);
    if (JSON.stringify(this.kinds) !== JSON.stringify(answer)) this.show(answer);
  }

  show(kinds) {
    const chosen = at("fault").value;
    this.kinds = kinds;
    const offered = kinds.filter((kind) => this.targets(kind).length);
    at("fault").replaceChildren(...offered.map(({ name, text: label }) => new Option(label, name)));
    if (offered.some(({ name }) => name === chosen)) at("fault").value = chosen;
    this.showTargets();
    const active = kinds.flatMap((kind) => kind.active.map((fault) => ({ ...fault, label: kind.text })));
    fill("fault-list", active.map((fault) => this.row(fault)));
    this.listen(active);
  }

  showTargets() {
    this.wait(null);
    const kind = this.chosen;
    const before = at("fault-target").value;
    const values = kind ? this.targets(kind).flatMap((target) => [[target, target], ...parts(target, kind)]) : [];
    at("fault-target").replaceChildren(...values.map(([label, value]) => new Option(label, value)));
    if (values.some(([, value]) => value === before)) at("fault-target").value = before;
    at("fault-cause").disabled = !values.length;
  }

  // A new obstacle has a name that no other has.
  targets({ kind, name, targets, active }) {
    return kind === "obstacle" ? [`${name}_${active.length + 1}`] : targets;
  }

  row({ target, part, label }) {
    const clear = text("Clear", "button");
    const where = part === null ? target : `${target} · ${part + 1}`;
    return row([text(`${where}: ${label}`), clear]);
  }

  listen(active) {
    [...at("fault-list").querySelectorAll("button")].forEach((button, i) => {
      const { fault, target, part } = active[i];
      button.onclick = () => this.change({ fault, target, part, active: false });
    });
  }
}

function parts(target, kind) {
  return Array.from({ length: kind.parts }, (_, i) => [`${target} · ${i + 1}`, `${target}#${i}`]);
}
