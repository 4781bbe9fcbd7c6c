// What can go wrong in a simulated world: choose a fault and what has it, cause it, clear it. Hidden where there is no simulator.
import { at, fill, hide, row, text } from "./panel.js";
import { ask } from "./wire.js";

export class Faults {
  constructor(order) {
    this.kinds = [];
    this.order = order;
    at("fault").addEventListener("change", () => this.showTargets());
    at("fault-cause").addEventListener("click", () => {
      const [target, part] = at("fault-target").value.split("#");
      this.change({ fault: at("fault").value, target, ...(part ? { part: Number(part) } : {}), active: true });
    });
  }

  async change(body) {
    await this.order("POST", "/world/faults", body);
    await this.load();
  }

  async load() {
    const { ok, answer } = await ask("GET", "/world/faults").catch(() => ({}));
    hide("faults", !ok);
    if (!ok) return;
    if (JSON.stringify(this.kinds) !== JSON.stringify(answer)) this.show(answer);
  }

  show(kinds) {
    const chosen = at("fault").value;
    const offered = kinds.filter(({ targets }) => targets.length);
    this.kinds = kinds;
    at("fault").replaceChildren(...offered.map(({ name, text: label }) => new Option(label, name)));
    if (offered.some(({ name }) => name === chosen)) at("fault").value = chosen;
    this.showTargets();
    const active = kinds.flatMap((kind) => kind.active.map((fault) => ({ ...fault, label: kind.text })));
    fill("fault-list", active.map((fault) => this.row(fault)));
    this.listen(active);
  }

  showTargets() {
    const kind = this.kinds.find(({ name }) => name === at("fault").value);
    const before = at("fault-target").value;
    const values = (kind?.targets ?? []).flatMap((target) => [[target, target], ...Array.from({ length: kind.parts }, (_, i) => [`${target} · ${i + 1}`, `${target}#${i}`])]);
    at("fault-target").replaceChildren(...values.map(([label, value]) => new Option(label, value)));
    if (values.some(([, value]) => value === before)) at("fault-target").value = before;
    at("fault-cause").disabled = !values.length;
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
