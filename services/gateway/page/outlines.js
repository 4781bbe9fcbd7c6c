// Racks at the places where they were measured. A rack that was set down stays drawn until another is seen there.
import { stroke, trace } from "./pen.js";

const SAME = 0.6; // metres between two measurements of one rack
const MOST = 50;

// Corners of a rack that was detected, from its size and the pose of its middle.
function corners({ pose: { pos, ori }, width, height }) {
  const [cos, sin] = [Math.cos(ori), Math.sin(ori)];
  return [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([along, across]) => {
    const [x, y] = [(along * height) / 2, (across * width) / 2];
    return [pos[0] + cos * x - sin * y, pos[1] + sin * x + cos * y];
  });
}

export class Racks {
  constructor() {
    this.carried = null; // the rack that the robot is under or carries: {pos, outline}
    this.parked = [];
  }

  hearLoad({ state, rack }) {
    if (!rack && this.carried && state === "free") this.park(this.carried);
    this.carried = rack ? { pos: rack.pose.pos, outline: rack.outline } : null;
    if (rack) this.forget(rack.pose.pos);
  }

  hearDetected({ rack_detected, rack_box }) {
    if (!rack_detected || !rack_box) return;
    const { pos } = rack_box.pose;
    if (this.carried && apart(this.carried.pos, pos) < SAME) return;
    this.park({ pos, outline: corners(rack_box) });
  }

  park(rack) {
    this.forget(rack.pos);
    this.parked = [...this.parked, rack].slice(-MOST);
  }

  forget(pos) {
    this.parked = this.parked.filter((rack) => apart(rack.pos, pos) >= SAME);
  }

  draw(view, colours) {
    for (const { outline } of this.parked) this.drawOne(view, outline, colours, "30", 2);
    if (this.carried) this.drawOne(view, this.carried.outline, colours, "48", 3);
  }

  drawOne(view, outline, colours, fill, width) {
    trace(view, outline, true);
    view.context.fillStyle = colours.rack + fill;
    view.context.fill();
    stroke(view.context, colours.rack, width);
  }
}

function apart(a, b) {
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}
