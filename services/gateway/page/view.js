// Which part of the map the canvas shows. Map coordinates are metres, y up; screen coordinates are CSS pixels, y down.

const NARROWEST = 4; // pixels a metre
const WIDEST = 600;

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.scale = 40; // pixels a metre
    this.centre = [0, 0];
    this.touched = false; // once the user has zoomed or panned, the view stays where it was put
  }

  // Makes the canvas as sharp as the screen. Returns its size in CSS pixels.
  resize() {
    const ratio = window.devicePixelRatio || 1;
    const { clientWidth, clientHeight } = this.canvas;
    const [width, height] = [Math.round(clientWidth * ratio), Math.round(clientHeight * ratio)];
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    return [clientWidth, clientHeight];
  }

  // The whole map, unless the user chose another part.
  fit(map) {
    if (this.touched || !map) return;
    const [width, height] = map.size.map((cells) => cells * map.resolution);
    this.centre = [map.origin[0] + width / 2, map.origin[1] + height / 2];
    this.scale = 0.985 * Math.min(this.canvas.clientWidth / width, this.canvas.clientHeight / height) || 40;
  }

  toScreen([x, y]) {
    return [
      this.canvas.clientWidth / 2 + (x - this.centre[0]) * this.scale,
      this.canvas.clientHeight / 2 - (y - this.centre[1]) * this.scale,
    ];
  }

  toMap([px, py]) {
    return [
      this.centre[0] + (px - this.canvas.clientWidth / 2) / this.scale,
      this.centre[1] - (py - this.canvas.clientHeight / 2) / this.scale,
    ];
  }

  // About a point of the screen, which goes on showing the same place.
  zoom(spot, factor) {
    const before = this.toMap(spot);
    this.scale = 0.985 * Math.min(Math.max(this.scale * factor, NARROWEST), WIDEST);
    const after = this.toMap(spot);
    this.centre = [this.centre[0] + before[0] - after[0], this.centre[1] + before[1] - after[1]];
    this.touched = true;
  }

  zoomAtCentre(factor) {
    this.zoom([this.canvas.clientWidth / 2, this.canvas.clientHeight / 2], factor);
  }

  pan(dx, dy) {
    this.centre = [this.centre[0] - dx / this.scale, this.centre[1] + dy / this.scale];
    this.touched = true;
  }
}
