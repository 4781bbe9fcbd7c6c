// The arm: who holds it, what it does, its stop, and jogging of its joints while a button is held. One CRF client.
import { at, badge, complain, hide, number, show } from "./panel.js";
import { Wire } from "./wire.js";

const PRIORITY = 50; // behind programs: whoever drives the arm is not interrupted by the page
const STREAM = { command: "startStreamStatus", frequency: 5 };
const JOG = 0.25; // rad/s
const JOG_PERIOD = 50; // ms
const DEADMAN = 0.25; // s after which the arm stops when no velocity comes
const USUAL = new Set([600, 602, 610]); // powered on, idle, calibrated
const NAMES = { 800: "Control loop late", 801: "Near a singularity", 802: "Contact or tracking error", 804: "End of the workspace", 603: "The driver does not follow" };

export class Arm {
  constructor(name) {
    this.name = name;
    this.joints = 0;
    this.jog = null; // {joint, sign} while a button is held
    this.wire = new Wire(`/motion/${name}/ws`, STREAM, (message) => this.receive(message), (up) => this.link(up));
    show("arm-name", name);
    hide("arm", false);
    at("arm-stop").addEventListener("click", () => this.send(this.stopped ? { command: "resumeControl", priority: PRIORITY } : { command: "softStop" }));
    at("arm-grip").addEventListener("click", () => this.grip());
    for (const type of ["pointerup", "pointercancel", "blur"]) addEventListener(type, () => this.release());
    document.addEventListener("visibilitychange", () => this.release());
  }

  send(request) {
    this.wire.send({ ...request, client: "gateway page", id: request.command });
  }

  // Whoever waits for control has it; no answer of this is looked at.
  unlock() {
    this.wire.send({ command: "unlockControl", priority: PRIORITY, client: "gateway page" });
  }

  grip() {
    this.send({ command: "setGripper", priority: PRIORITY, suction: !this.suction });
    this.unlock();
  }

  link(up) {
    if (!up) badge("arm-state", "no connection", "bad");
  }

  receive({ replyCommand, message, text, id }) {
    if (replyCommand === "streamStatus") this.show(message);
    else if (id && (replyCommand === "error" || (message?.code ?? 200) >= 400)) {
      this.release();
      complain(`${this.name}: ${id} was refused (${message?.code ?? message})${text ? `: ${text}` : ""}`);
    }
  }

  show({ holder, stoppedBy, isTrajectoryRunning, controllerStatus, jointPositions, gripper }) {
    this.stopped = Boolean(stoppedBy);
    const faults = controllerStatus.filter((code) => code >= 400 && !USUAL.has(code)).map((code) => `${code} ${NAMES[code] ?? ""}`.trim());
    const running = isTrajectoryRunning?.value;
    if (this.stopped) badge("arm-state", "stopped", "bad");
    else badge("arm-state", running ? "on a path" : "at rest", faults.length ? "warn" : running ? "busy" : "good");
    show("arm-holder", holder ? `${holder.client} · priority ${holder.priority}` : "nobody");
    show("arm-faults", stoppedBy ? `stopped by ${stoppedBy}` : faults.join(", ") || "none");
    show("arm-stop", this.stopped ? "Release the stop" : "Soft stop");
    hide("arm-grip", !gripper);
    this.suction = gripper?.suction;
    if (gripper) show("arm-grip", gripper.suction ? `Suction off${gripper.holding ? " · holds an item" : ""}` : "Suction on");
    this.showJoints(jointPositions?.value ?? []);
  }

  showJoints(values) {
    if (values.length !== this.joints) this.makeJoints(values.length);
    values.forEach((value, i) => {
      const angle = at("arm-joints").children[i].querySelector("output");
      const text = `${number((value * 180) / Math.PI, 0)}°`;
      if (angle.textContent !== text) angle.textContent = text;
    });
  }

  makeJoints(count) {
    this.joints = count;
    at("arm-joints").replaceChildren(...Array.from({ length: count }, (_, i) => {
      const row = document.createElement("li");
      row.append(`joint ${i + 1}`, document.createElement("output"), this.button(i, -1, "−"), this.button(i, 1, "+"));
      return row;
    }));
  }

  button(joint, sign, label) {
    const button = document.createElement("button");
    button.textContent = label;
    button.setAttribute("aria-label", `Jog joint ${joint + 1} ${sign > 0 ? "forward" : "backward"} while held`);
    button.addEventListener("pointerdown", () => this.hold(joint, sign));
    button.addEventListener("pointerleave", () => this.release());
    button.addEventListener("keydown", ({ code, repeat }) => {
      if ((code === "Space" || code === "Enter") && !repeat) this.hold(joint, sign);
    });
    button.addEventListener("keyup", () => this.release());
    return button;
  }

  hold(joint, sign) {
    this.release();
    if (this.stopped) { // a velocity of the client that stopped the arm would end the stop
      complain(`${this.name} is stopped: release the stop first.`);
      return;
    }
    this.jog = setInterval(() => this.move(joint, sign * JOG), JOG_PERIOD);
    this.move(joint, sign * JOG);
  }

  // The arm brakes at once.
  release() {
    if (this.jog === null) return;
    clearInterval(this.jog);
    this.jog = null;
    this.move(0, 0);
    this.unlock();
  }

  move(joint, speed) {
    const data = Array(this.joints).fill(0);
    data[joint] = speed;
    this.send({ command: "setVelocity", priority: PRIORITY, type: "joints", data, timeout: DEADMAN });
  }
}

// The card of the first arm that the cell has.
export function findArm(health, known) {
  const row = health?.services.find(({ service }) => service === "controller");
  if (row && !known.arm) known.arm = new Arm(row.robot);
}
