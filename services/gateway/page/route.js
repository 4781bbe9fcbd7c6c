// A route that is drawn by clicks, and driven as one move along it.
import { at } from "./panel.js";
import { dot, stroke, trace } from "./pen.js";

export class Route {
  constructor(order, changed) {
    this.points = [];
    this.drawing = false;
    this.order = order;
    this.changed = changed;
    at("route").addEventListener("click", () => this.begin(!this.drawing));
    at("route-drive").addEventListener("click", () => this.drive());
  }

  begin(drawing) {
    this.drawing = drawing;
    this.points = [];
    this.show();
  }

  // Takes a click on the map. False while no route is drawn.
  add(pos) {
    if (!this.drawing) return false;
    this.points.push(pos);
    this.show();
    return true;
  }

  drive() {
    const coordinates = this.points.map(([x, y]) => `${x.toFixed(3)}, ${y.toFixed(3)}`).join(", ");
    this.order("POST", "/chassis/moves", {
      creator: "gateway page", type: "along_given_route", route_coordinates: coordinates, detour_tolerance: 0,
    });
    this.begin(false);
  }

  show() {
    at("route").setAttribute("aria-pressed", this.drawing);
    at("route").textContent = this.drawing ? "Discard the route" : "Draw a route";
    at("route-drive").hidden = this.points.length < 2;
    this.changed();
  }

  draw(view, colours) {
    if (!this.points.length) return;
    trace(view, this.points, false);
    stroke(view.context, colours.aim, 2.5, [6, 4]);
    for (const point of this.points) {
      dot(view, point, 4);
      view.context.fillStyle = colours.aim;
      view.context.fill();
    }
  }
}
