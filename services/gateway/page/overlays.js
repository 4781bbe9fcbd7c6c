// What the map's GeoJSON says of places: zones, virtual walls, racks, the charger, points with a name.
import { FONT, dot, label, stroke, trace } from "./pen.js";

const ROOM_FOR_NAMES = 28; // pixels a metre; below, names would lie on each other

// regionType: its colour, and what it means where it has no name.
const REGIONS = {
  1: ["forbidden", "no entry"], 2: ["slow", "slow"], 3: ["lift", ""], 4: ["lift", "gate"], 5: ["lift", "door"],
  13: ["charger", "charging"], 17: ["rack", ""],
};
const LINES = { 1: ["path", []], 2: ["forbidden", [8, 5]], 3: ["quiet", [4, 4]], 4: ["quiet", [2, 5]] };
const [CHARGER, RACK, DOCKING] = ["9", "34", "36"];
const RACK_SIDE = 0.8; // metres; a place for a rack, not a rack's own size

// `racks`: what is known of rack points, by id, and the id of the one that is chosen.
export function drawOverlays(view, overlays, colours, racks) {
  view.context.font = FONT; // names are measured before they are written
  const features = (overlays?.features ?? []).filter(({ geometry }) => geometry);
  const of = (kind) => features.filter(({ geometry }) => geometry.type === kind);
  for (const feature of of("Polygon")) drawRegion(view, feature, colours);
  for (const feature of of("LineString")) drawLine(view, feature, colours);
  for (const feature of of("Point")) drawPoint(view, feature, colours, racks);
}

function drawRegion(view, { geometry, properties }, colours) {
  const ring = geometry.coordinates[0] ?? [];
  if (!ring.length) return;
  const [kind, meaning] = REGIONS[properties?.regionType] ?? ["quiet", ""];
  trace(view, ring, true);
  view.context.fillStyle = colours[kind] + "1c";
  view.context.fill();
  stroke(view.context, colours[kind] + "90", 1);
  if (view.scale < ROOM_FOR_NAMES) return;
  const [xs, ys] = [0, 1].map((axis) => ring.map((point) => point[axis]));
  const room = (Math.max(...xs) - Math.min(...xs)) * view.scale - 12;
  const name = readable(properties?.name ?? "");
  const wide = (text) => view.context.measureText(text).width;
  const text = [[name, meaning].filter(Boolean).join(" · "), name].find((choice) => wide(choice) <= room);
  if (!text) return;
  const [x, y] = view.toScreen([Math.min(...xs), Math.max(...ys)]);
  label(view, text, [x + 6 + wide(text) / 2, y + 14], colours[kind], colours.halo);
}

function drawLine(view, { geometry, properties }, colours) {
  const [kind, dash] = LINES[properties?.lineType] ?? LINES[3];
  trace(view, geometry.coordinates, false);
  stroke(view.context, colours[kind], 2, dash);
}

function drawPoint(view, { id, geometry, properties }, colours, { states, chosen }) {
  const [x, y] = view.toScreen(geometry.coordinates);
  const type = String(properties?.type);
  const pen = view.context;
  let below = 16;
  if (type === RACK) {
    const half = (RACK_SIDE / 2) * view.scale;
    const yaw = (Number(properties.yaw ?? 0) * Math.PI) / 180; // overlays alone count in degrees
    pen.save();
    pen.translate(x, y);
    pen.rotate(-yaw);
    pen.beginPath();
    pen.rect(-half, -half, 2 * half, 2 * half);
    if (states[id] === "occupied") {
      pen.fillStyle = colours.rack + "30";
      pen.fill();
    }
    stroke(pen, colours.rack, 1.5, states[id] === "free" ? [] : [4, 3]);
    if (String(id) === chosen) {
      pen.beginPath();
      pen.rect(-half - 4, -half - 4, 2 * half + 8, 2 * half + 8);
      stroke(pen, colours.aim, 2.5);
    }
    pen.beginPath(); // the side a robot comes from
    pen.moveTo(-half, -half);
    pen.lineTo(-half, half);
    stroke(pen, colours.rack, 3);
    pen.restore();
    below = 4;
  } else if (type === CHARGER) {
    pen.beginPath();
    for (const [dx, dy] of [[2, -9], [-5, 2], [-1, 2], [-2, 9], [5, -2], [1, -2]]) pen.lineTo(x + dx, y + dy);
    pen.closePath();
    pen.fillStyle = colours.charger;
    pen.fill();
    below = 20;
  } else {
    dot(view, geometry.coordinates, type === DOCKING ? 2 : 3.5);
    pen.fillStyle = type === DOCKING ? colours.charger : colours.quiet;
    pen.fill();
  }
  const name = readable(properties?.name ?? "");
  if (!name || view.scale < ROOM_FOR_NAMES || x < 0 || x > view.canvas.clientWidth) return;
  const half = pen.measureText(name).width / 2 + 6; // a name at the canvas' edge is moved in
  const middle = Math.min(Math.max(x, half), view.canvas.clientWidth - half);
  label(view, name, [middle, y + below], type === CHARGER ? colours.charger : colours.label, colours.halo);
}

function readable(name) {
  return String(name).replaceAll("_", " ");
}
