// Strokes of the map's drawings. Points are [x, y] in map coordinates, lengths in pixels.

export const FONT = "11px system-ui, sans-serif";

export function trace(view, points, closed) {
  view.context.beginPath();
  points.forEach((point, index) => view.context[index ? "lineTo" : "moveTo"](...view.toScreen(point)));
  if (closed) view.context.closePath();
}

export function stroke(pen, colour, width, dash = []) {
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.setLineDash(dash);
  pen.stroke();
  pen.setLineDash([]);
}

export function dot(view, point, radius) {
  view.context.beginPath();
  view.context.arc(...view.toScreen(point), radius, 0, 2 * Math.PI);
}

// From the first distance to the second, seen from the point.
export function arrow(view, point, ori, [begin, end], colour) {
  const [x, y] = view.toScreen(point);
  const at = (distance, turn = 0, from = [x, y]) =>
    [from[0] + distance * Math.cos(ori + turn), from[1] - distance * Math.sin(ori + turn)];
  const tip = at(end);
  const pen = view.context;
  pen.beginPath();
  pen.moveTo(...at(begin));
  pen.lineTo(...tip);
  pen.moveTo(...at(-8, 0.5, tip));
  pen.lineTo(...tip);
  pen.lineTo(...at(-8, -0.5, tip));
  stroke(pen, colour, 2.5);
}

// Text with a halo, so that it can be read on everything.
export function label(view, text, [x, y], colour, halo) {
  const pen = view.context;
  pen.font = FONT;
  pen.textAlign = "center";
  pen.lineJoin = "round";
  pen.strokeStyle = halo;
  pen.lineWidth = 3;
  pen.strokeText(text, x, y);
  pen.fillStyle = colour;
  pen.fillText(text, x, y);
}
