// The live map: what is known, drawn from the floor up.
import { drawRacks } from "./outlines.js";
import { drawOverlays } from "./overlays.js";
import { arrow, dot, label, stroke, trace } from "./pen.js";
import { rackStates } from "./racks.js";


export function draw(view, known, aim, colours) {
  const [width, height] = view.resize();
  view.fit(known.map);
  view.context.clearRect(0, 0, width, height);
  drawMap(view, known, colours);
  drawGrid(view, known.map, colours);
  drawOverlays(view, known.info?.overlays, colours, { states: rackStates(known.rackStates), chosen: known.chosen });
  drawRacks(view, known, colours);
  drawTrail(view, known.trail, colours);
  drawPath(view, known, colours);
  drawScan(view, known.scan?.points, colours);
  const target = known.planning?.move_state === "moving" ? known.planning.target_poses[0] : null;
  if (target) drawTarget(view, target, colours.path, colours.halo);
  if (known.pose) drawRobot(view, known, colours);
  if (known.explained && known.explained.id === known.planning?.action_id) drawThings(view, known.explained.things, colours);
  known.route.draw(view, colours);
  if (aim) drawTarget(view, aim, colours.aim, colours.halo);
  drawScale(view, height, colours);
}

// The map's picture in this page's colours; what is neither occupied nor free is left out.
export function paintMap(image, colours) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.width, image.height];
  const pen = canvas.getContext("2d");
  pen.drawImage(image, 0, 0);
  const pixels = pen.getImageData(0, 0, canvas.width, canvas.height);
  const [wall, floor] = [rgb(pen, colours.wall), rgb(pen, colours.floor)];
  for (let at = 0; at < pixels.data.length; at += 4) {
    const grey = pixels.data[at];
    pixels.data.set(grey < 100 ? wall : grey > 230 ? floor : [0, 0, 0, 0], at);
  }
  pen.putImageData(pixels, 0, 0);
  return canvas;
}

function rgb(pen, colour) {
  pen.fillStyle = colour; // the browser spells it out
  return [...pen.fillStyle.match(/[0-9a-f]{2}/gi).map((part) => parseInt(part, 16)), 255];
}

function drawMap(view, { map, painted }) {
  if (!map || !painted) return;
  const [x, y] = view.toScreen([map.origin[0], map.origin[1] + map.size[1] * map.resolution]);
  const cell = map.resolution * view.scale;
  view.context.imageSmoothingEnabled = cell < 1;
  view.context.drawImage(painted, x, y, map.size[0] * cell, map.size[1] * cell);
}

// A line every metre, or every five where metres would be too dense.
function drawGrid(view, map, colours) {
  if (!map) return;
  const step = view.scale >= 24 ? 1 : 5;
  const [left, bottom] = map.origin;
  const [right, top] = [left + map.size[0] * map.resolution, bottom + map.size[1] * map.resolution];
  const pen = view.context;
  pen.beginPath();
  for (let x = Math.ceil(left / step) * step; x <= right; x += step) line(view, [x, bottom], [x, top]);
  for (let y = Math.ceil(bottom / step) * step; y <= top; y += step) line(view, [left, y], [right, y]);
  stroke(pen, colours.grid, 1);
}

function line(view, begin, end) {
  view.context.moveTo(...view.toScreen(begin));
  view.context.lineTo(...view.toScreen(end));
}

function drawTrail(view, trail, colours) {
  if (!trail?.length) return;
  trace(view, trail, false);
  stroke(view.context, colours.trail, 2, [1, 5]);
}

function drawPath(view, { path, planning }, colours) {
  if (!path?.positions.length || planning?.move_state !== "moving") return;
  trace(view, path.positions, false);
  stroke(view.context, colours.halo, 6);
  stroke(view.context, colours.path, 3);
}

function drawScan(view, points, colours) {
  view.context.fillStyle = colours.scan;
  for (const point of points ?? []) {
    const [x, y] = view.toScreen(point);
    view.context.fillRect(x - 1.25, y - 1.25, 2.5, 2.5);
  }
}

// A cross where the things are that explain the move, with what they are.
function drawThings(view, things, colours) {
  for (const { pos, kind } of things) {
    const [x, y] = view.toScreen(pos);
    for (const [colour, width] of [[colours.halo, 6], [colours.stopped, 3]]) {
      view.context.beginPath();
      for (const [dx, dy] of [[-7, -7], [-7, 7]]) {
        view.context.moveTo(x + dx, y + dy);
        view.context.lineTo(x - dx, y - dy);
      }
      stroke(view.context, colour, width);
    }
    label(view, kind, [x, y - 12], colours.stopped, colours.halo);
  }
}

// Footprints have x to the robot's right and y to its front.
function drawRobot(view, { pose: { pos, ori }, model, body, planning, wheels }, colours) {
  const [cos, sin] = [Math.cos(ori), Math.sin(ori)];
  const toMap = ([right, front]) => [pos[0] + cos * front + sin * right, pos[1] + sin * front - cos * right];
  const moving = planning?.move_state === "moving";
  const stuck = moving && planning.stuck_state && planning.stuck_state !== "none";
  const pen = view.context;
  pen.lineJoin = "round";
  if (!model) { // the driver has not described its chassis yet
    dot(view, pos, 6);
    stroke(pen, colours.robot, 2);
    return;
  }
  const footprint = body ?? model.footprint;
  const differs = (outline) => JSON.stringify(outline) !== JSON.stringify(footprint);
  for (const [outline, dash] of [[model.expanded_footprint, [3, 3]], [model.footprint, []]]) {
    if (!differs(outline)) continue; // with a rack, the outline that must not touch anything is larger
    trace(view, outline.map(toMap), true);
    stroke(pen, colours.robot, 1.5, dash);
  }
  trace(view, footprint.map(toMap), true);
  stroke(pen, colours.halo, 5);
  pen.fillStyle = wheels?.emergency_stop_pressed ? colours.stopped : stuck ? colours.warn : colours.robot;
  pen.fill();
  const front = 0.75 * Math.max(...footprint.map(([, y]) => y));
  const half = 0.7 * Math.max(...footprint.map(([x]) => x));
  trace(view, [[-half, 0], [0, front], [half, 0]].map(toMap), false);
  stroke(pen, colours.nose, Math.max(1.5, 0.05 * view.scale));
  // A robot smaller than a finger is ringed, so that it is found.
  if (front * view.scale < 10) {
    dot(view, pos, 11);
    stroke(pen, colours.robot, 2);
  }
}

function drawTarget(view, { pos, ori }, colour, halo) {
  dot(view, pos, 8);
  stroke(view.context, halo, 5);
  stroke(view.context, colour, 2.5);
  dot(view, pos, 2.5);
  view.context.fillStyle = colour;
  view.context.fill();
  if (ori !== undefined && ori !== null) arrow(view, pos, ori, [8, 30], colour);
}

// A bar of a round number of metres, in the lower left corner.
function drawScale(view, height, colours) {
  const metres = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20].find((length) => length * view.scale >= 60) ?? 50;
  const pen = view.context;
  const [x, y, long] = [14, height - 14, metres * view.scale];
  pen.beginPath();
  pen.moveTo(x, y - 5);
  pen.lineTo(x, y);
  pen.lineTo(x + long, y);
  pen.lineTo(x + long, y - 5);
  stroke(pen, colours.halo, 5);
  stroke(pen, colours.quiet, 1.5);
  label(view, `${metres} m`, [x + long / 2, y - 5], colours.quiet, colours.halo);
}
