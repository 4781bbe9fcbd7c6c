// Rack jobs: places to choose, and the orders for the rack there. Orders go to `order(method, path, body)`.
import { at } from "./panel.js";

const [RACK_POINT, RACK_AREA] = ["34", "17"];
const REACH = 0.4; // metres around a rack point that a click means it
const UP = 0.999; // of the jack's progress
const AREA = "area:"; // before the id of an area, among the values of the list

// The rack points of a map, and the areas they are in.
export function rackPlaces(overlays) {
  const places = [];
  for (const { id, geometry, properties } of overlays?.features ?? []) {
    const name = String(properties?.name ?? id).replaceAll("_", " ");
    if (geometry?.type === "Point" && String(properties?.type) === RACK_POINT) {
      const degrees = properties.yaw === undefined || properties.yaw === "" ? null : Number(properties.yaw);
      places.push({ key: String(id), name, pos: geometry.coordinates.slice(0, 2), yaw: degrees === null ? null : (degrees * Math.PI) / 180 });
    } else if (geometry?.type === "Polygon" && String(properties?.regionType) === RACK_AREA) {
      places.push({ key: AREA + id, name, area: String(id) });
    }
  }
  return places;
}

// What is known of each rack point, by its id: unknown, free or occupied.
export function rackStates(message) {
  const rows = (message?.racks ?? []).map(({ poi_id, levels }) => {
    const states = levels.map(({ state }) => state);
    return [poi_id, states.includes("occupied") ? "occupied" : states.length && states.every((state) => state === "free") ? "free" : "unknown"];
  });
  return Object.fromEntries(rows);
}

export class RackJobs {
  constructor(order, changed) {
    this.places = [];
    this.list = at("rack-place");
    this.order = order;
    this.list.addEventListener("change", changed);
    at("rack-align").addEventListener("click", () => this.move("align_with_rack"));
    at("rack-carry").addEventListener("click", () => this.move("to_unload_point"));
    at("rack-lift").addEventListener("click", () => order("POST", "/services/jack_up", {}));
    at("rack-lower").addEventListener("click", () => order("POST", "/services/jack_down", {}));
  }

  get chosen() {
    return this.places.find(({ key }) => key === this.list.value);
  }

  // The rack point at a place of the map is chosen. False where there is none.
  choose([x, y]) {
    const near = this.places.filter(({ pos }) => pos && Math.hypot(pos[0] - x, pos[1] - y) < REACH);
    if (!near.length) return false;
    const away = ({ pos }) => Math.hypot(pos[0] - x, pos[1] - y);
    this.list.value = near.reduce((best, place) => (away(place) < away(best) ? place : best)).key;
    return true;
  }

  move(type) {
    const { pos, yaw, area } = this.chosen ?? {};
    const move = { creator: "gateway page", type };
    if (area) move.rack_area_id = area;
    else if (pos) Object.assign(move, { target_x: pos[0], target_y: pos[1] }, yaw === null ? {} : { target_ori: yaw });
    this.order("POST", "/chassis/moves", move);
  }

  show({ info, rackStates: seen, jack, planning }) {
    this.fill(rackPlaces(info?.overlays), rackStates(seen));
    const moving = planning?.move_state === "moving";
    const progress = jack?.progress ?? 0;
    const down = jack && jack.state === "hold" && progress <= 1 - UP;
    const up = jack && jack.state === "hold" && progress >= UP;
    at("rack-align").disabled = !this.chosen || !down;
    at("rack-carry").disabled = !this.chosen || !(up || jack?.state === "jacking_up");
    at("rack-lift").disabled = !jack || moving || up || jack.state === "jacking_up";
    at("rack-lower").disabled = !jack || moving || down || jack.state === "jacking_down";
    at("jack-progress").value = progress;
  }

  // The choice stays while its place does. Points come before areas, as most jobs are from point to point.
  fill(places, states) {
    const rows = places.map(({ key, name, area }) => [key, area ? `any in ${name}` : `${name} · ${states[key] ?? "unknown"}`]);
    rows.sort(([a], [b]) => a.startsWith(AREA) - b.startsWith(AREA));
    const text = JSON.stringify(rows);
    if (this.shown === text) return;
    this.shown = text;
    this.places = places;
    const before = this.list.value;
    const none = new Option(rows.length ? "choose a rack point" : "the map has no rack points", "");
    this.list.replaceChildren(none, ...rows.map(([key, label]) => new Option(label, key)));
    this.list.value = rows.some(([key]) => key === before) ? before : "";
    this.list.disabled = !rows.length;
  }
}
