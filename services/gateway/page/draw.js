// The live map: what is known, drawn in map coordinates (metres, y up).

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.scale = 40; // pixels a metre
    this.centre = [0, 0];
    this.touched = false; // once the user has zoomed or panned, the view stays where it was put
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (this.canvas.width !== width * ratio || this.canvas.height !== height * ratio) {
      this.canvas.width = width * ratio;
      this.canvas.height = height * ratio;
    }
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    return [width, height];
  }

  fit(map) {
    if (this.touched || !map) return;
    const [width, height] = map.size.map((n) => n * map.resolution);
    this.centre = [map.origin[0] + width / 2, map.origin[1] + height / 2];
    this.scale = 0.96 * Math.min(this.canvas.clientWidth / width, this.canvas.clientHeight / height) || 40;
  }

  toScreen([x, y]) {
    return [
      this.canvas.clientWidth / 2 + (x - this.centre[0]) * this.scale,
      this.canvas.clientHeight / 2 - (y - this.centre[1]) * this.scale,
    ];
  }

  toMap(px, py) {
    return [
      this.centre[0] + (px - this.canvas.clientWidth / 2) / this.scale,
      this.centre[1] - (py - this.canvas.clientHeight / 2) / this.scale,
    ];
  }

  zoom(px, py, factor) {
    const before = this.toMap(px, py);
    this.scale = Math.min(Math.max(this.scale * factor, 4), 600);
    const after = this.toMap(px, py);
    this.centre = [this.centre[0] + before[0] - after[0], this.centre[1] + before[1] - after[1]];
    this.touched = true;
  }

  pan(dx, dy) {
    this.centre = [this.centre[0] - dx / this.scale, this.centre[1] + dy / this.scale];
    this.touched = true;
  }
}

export function draw(view, known, aim) {
  const [width, height] = view.resize();
  view.fit(known.map);
  const pen = view.context;
  pen.clearRect(0, 0, width, height);
  drawMap(view, known);
  drawOverlays(view, known.info?.overlays);
  drawScan(view, known.scan?.points);
  drawPath(view, known.path?.positions);
  const target = known.planning?.move_state === "moving" ? known.planning.target_poses[0] : null;
  if (target) drawTarget(view, target.pos, target.ori, "#0b6bcb");
  if (known.pose) drawRobot(view, known.pose, known.model?.footprint, known.planning?.stuck_state);
  if (aim) drawTarget(view, aim.pos, aim.ori, "#d9480f");
}

function drawMap(view, { map, image }) {
  if (!map || !image) return;
  const [x, y] = view.toScreen([map.origin[0], map.origin[1] + map.size[1] * map.resolution]);
  const cell = map.resolution * view.scale;
  view.context.imageSmoothingEnabled = cell < 1;
  view.context.drawImage(image, x, y, map.size[0] * cell, map.size[1] * cell);
}

const REGIONS = { 1: "#c0352b", 2: "#e0a800", 3: "#7048e8", 13: "#12805c", 17: "#0b6bcb" };

function drawOverlays(view, overlays) {
  const pen = view.context;
  pen.font = "11px system-ui, sans-serif";
  for (const { geometry, properties } of overlays?.features ?? []) {
    if (geometry?.type === "Polygon") {
      const colour = REGIONS[properties?.regionType] ?? "#66778a";
      trace(view, geometry.coordinates[0] ?? [], true);
      pen.fillStyle = colour + "22";
      pen.fill();
      stroke(pen, colour + "99", 1);
    } else if (geometry?.type === "LineString") {
      trace(view, geometry.coordinates, false);
      stroke(pen, String(properties?.lineType) === "2" ? "#c0352b" : "#66778a", 2, [6, 4]);
    } else if (geometry?.type === "Point") {
      const [x, y] = view.toScreen(geometry.coordinates);
      pen.fillStyle = "#0b6bcbaa";
      pen.fillRect(x - 3, y - 3, 6, 6);
      if (properties?.name) pen.fillText(properties.name, x + 6, y + 4);
    }
  }
}

function drawScan(view, points) {
  view.context.fillStyle = "#d9480f";
  for (const point of points ?? []) {
    const [x, y] = view.toScreen(point);
    view.context.fillRect(x - 1, y - 1, 2.2, 2.2);
  }
}

function drawPath(view, positions) {
  if (!positions?.length) return;
  trace(view, positions, false);
  stroke(view.context, "#0b6bcb", 2.5);
}

// Footprints have x to the robot's right and y to its front.
function drawRobot(view, { pos, ori }, footprint, stuck) {
  const [cos, sin] = [Math.cos(ori), Math.sin(ori)];
  const corners = (footprint ?? [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    .map(([right, front]) => [pos[0] + cos * front + sin * right, pos[1] + sin * front - cos * right]);
  trace(view, corners, true);
  view.context.fillStyle = stuck && stuck !== "none" ? "#a66300dd" : "#12805cdd";
  view.context.fill();
  stroke(view.context, "#fff", 1.5);
  arrow(view, pos, ori, 0.3, "#fff");
}

function drawTarget(view, pos, ori, colour) {
  const [x, y] = view.toScreen(pos);
  view.context.beginPath();
  view.context.arc(x, y, 7, 0, 2 * Math.PI);
  stroke(view.context, colour, 2.5);
  if (ori !== undefined && ori !== null) arrow(view, pos, ori, 0.6, colour);
}

function arrow(view, [x, y], ori, length, colour) {
  const tip = [x + length * Math.cos(ori), y + length * Math.sin(ori)];
  const barb = (turn) => [tip[0] - 0.35 * length * Math.cos(ori + turn), tip[1] - 0.35 * length * Math.sin(ori + turn)];
  trace(view, [[x, y], tip], false);
  stroke(view.context, colour, 2.5);
  trace(view, [barb(0.5), tip, barb(-0.5)], false);
  stroke(view.context, colour, 2.5);
}

function trace(view, points, closed) {
  view.context.beginPath();
  points.forEach((point, index) => view.context[index ? "lineTo" : "moveTo"](...view.toScreen(point)));
  if (closed) view.context.closePath();
}

function stroke(pen, colour, width, dash = []) {
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.setLineDash(dash);
  pen.stroke();
  pen.setLineDash([]);
}
