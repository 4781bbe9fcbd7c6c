// Pointers and keys, as what they mean: an aim, a move, another view, remote driving.

const HEADING = 14; // pixels a drag is long before it gives a heading
const TWIST_PERIOD = 50; // ms; the robot stops by itself when twists stay out
const UNANSWERED = 5; // twists on their way, after which the next ones wait
const SPEED = { linear: 0.5, angular: 0.8 }; // m/s, rad/s
const KEYS = {
  ArrowUp: "forward", KeyW: "forward", ArrowDown: "backward", KeyS: "backward",
  ArrowLeft: "left", KeyA: "left", ArrowRight: "right", KeyD: "right",
};

// `onAim` gets {pos, ori?} or null while the user aims, `onGo` the aim that was meant, `onView` that the view changed,
// `onHover` the place under the mouse or null.
export function listenToMap(view, { onAim, onGo, onView, onHover }) {
  const canvas = view.canvas;
  const down = new Map(); // pointers pressed: id → [x, y]
  let pressed = null; // where the aim began
  let aim = null;

  const spot = ({ clientX, clientY }) => {
    const box = canvas.getBoundingClientRect();
    return [clientX - box.left - canvas.clientLeft, clientY - box.top - canvas.clientTop];
  };
  const drop = () => { pressed = null; onAim((aim = null)); };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, spot(event));
    if (down.size === 1 && event.button === 0) {
      pressed = spot(event);
      onAim((aim = { pos: view.toMap(pressed) }));
    } else if (pressed) {
      drop(); // a second finger: not an aim after all
    }
  });
  canvas.addEventListener("pointermove", (event) => {
    const now = spot(event);
    if (event.pointerType === "mouse") onHover(view.toMap(now));
    if (!down.has(event.pointerId)) return;
    if (pressed) {
      const far = Math.hypot(now[0] - pressed[0], now[1] - pressed[1]) > HEADING;
      onAim((aim = { pos: aim.pos, ori: far ? Math.atan2(pressed[1] - now[1], now[0] - pressed[0]) : undefined }));
    } else {
      shift(view, down, event.pointerId, now);
      onView();
    }
    down.set(event.pointerId, now);
  });
  canvas.addEventListener("pointerup", (event) => {
    down.delete(event.pointerId);
    if (!pressed) return;
    const meant = aim;
    drop();
    onGo(meant);
  });
  canvas.addEventListener("pointercancel", (event) => { down.delete(event.pointerId); drop(); });
  canvas.addEventListener("pointerleave", () => onHover(null));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    view.zoom(spot(event), Math.exp(-event.deltaY / 500));
    onView();
  }, { passive: false });
  addEventListener("keydown", ({ key }) => { if (key === "Escape" && pressed) drop(); });
}

// One pointer pans; two pan and zoom about the one that rests.
function shift(view, down, id, now) {
  const before = down.get(id);
  const other = [...down].find(([pointer]) => pointer !== id)?.[1];
  if (!other) {
    view.pan(now[0] - before[0], now[1] - before[1]);
    return;
  }
  const distance = (point) => Math.max(Math.hypot(point[0] - other[0], point[1] - other[1]), 1);
  view.pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
  view.zoom(other, distance(now) / distance(before));
}

// Remote driving while `allowed()`: keys and the pad's buttons that are held become twists. Call `answered()` for each
// that the robot took.
export class Drive {
  constructor(pad, allowed, send) {
    this.held = new Set();
    this.allowed = allowed;
    this.send = send;
    this.timer = null;
    this.unanswered = 0;
    for (const button of pad.querySelectorAll("[data-drive]")) {
      button.addEventListener("pointerdown", () => this.hold(button.dataset.drive));
      for (const end of ["pointerup", "pointerleave", "pointercancel"]) {
        button.addEventListener(end, () => this.release(button.dataset.drive));
      }
    }
    addEventListener("keydown", (event) => {
      if (!KEYS[event.code] || !allowed() || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      this.hold(KEYS[event.code]);
    });
    addEventListener("keyup", ({ code }) => this.release(KEYS[code]));
    addEventListener("blur", () => this.releaseAll());
  }

  hold(direction) {
    this.held.add(direction);
    if (this.timer === null) {
      this.unanswered = 0;
      this.timer = setInterval(() => this.step(), TWIST_PERIOD);
    }
  }

  release(direction) {
    if (this.held.delete(direction) && !this.held.size) this.step();
  }

  releaseAll() {
    for (const direction of [...this.held]) this.release(direction);
  }

  answered() {
    this.unanswered = Math.max(this.unanswered - 1, 0);
  }

  step() {
    const over = !this.held.size || !this.allowed();
    if (over) {
      clearInterval(this.timer);
      this.timer = null;
      this.held.clear();
    } else if (this.unanswered >= UNANSWERED) {
      return;
    }
    const side = (one, other) => Number(this.held.has(one)) - Number(this.held.has(other));
    this.unanswered += 1;
    this.send({
      topic: "/twist",
      linear_velocity: SPEED.linear * side("forward", "backward"),
      angular_velocity: SPEED.angular * side("left", "right"),
    });
  }
}
