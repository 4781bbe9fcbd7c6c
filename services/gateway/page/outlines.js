// Racks at the places where they were measured.
import { stroke, trace } from "./pen.js";

const DETECTED = 3000; // ms for which a rack that was detected stays drawn

// Corners of a rack that was detected, from its size and the pose of its middle.
function corners({ pose: { pos, ori }, width, height }) {
  const [cos, sin] = [Math.cos(ori), Math.sin(ori)];
  return [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([along, across]) => {
    const [x, y] = [(along * height) / 2, (across * width) / 2];
    return [pos[0] + cos * x - sin * y, pos[1] + sin * x + cos * y];
  });
}

// Those on the floor, the one that the robot is under or carries, and what a search shows at the moment.
export function drawRacks(view, { seenRacks, load, detected, detectedAt }, colours) {
  for (const { outline } of seenRacks?.racks ?? []) drawOne(view, outline, colours.rack, "30", 2);
  if (load?.rack) drawOne(view, load.rack.outline, colours.rack, "48", 3);
  const fresh = Date.now() - (detectedAt ?? 0) < DETECTED;
  if (fresh && detected?.rack_box) drawOne(view, corners(detected.rack_box), colours.aim, "00", 2);
}

function drawOne(view, outline, colour, fill, width) {
  trace(view, outline, true);
  view.context.fillStyle = colour + fill;
  view.context.fill();
  stroke(view.context, colour, width);
}
