"""What the scans show of a lift: where its doorway is, how far that is closed, and whether a place in it is free.

The map is the prior: a zone of type 3 is the inside of the cabin, walls are drawn, doors are not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.explain import Thing
from rackhand.schemas.maps import RegionType
from rackhand.services.planner.control.lift_entry import PointState, Whereabouts
from rackhand.services.planner.geometry.cells import cells_in
from rackhand.services.planner.geometry.footprint import Footprint, expanded
from rackhand.services.planner.geometry.polygon import inside_convex
from rackhand.services.planner.geometry.se2 import Pose, compose, transformed
from rackhand.services.planner.map.grid import StaticMap
from rackhand.services.planner.map.overlays import MapOverlays, Zone
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.perception.seen_scan import SeenScan
from rackhand.services.planner.perception.things import thing_at

Array = NDArray[np.float64]

DOOR_REACH = 0.35  # m outside the zone in which doors are
DOOR_BEHIND = 0.2  # m inside it
DOOR_FACE = 0.2  # m outside it, beyond which a body is clear of the doors
WIDEST = 2.0  # m from the middle of a doorway to either side
JAMB, BIN = 0.08, 0.1  # m beside a jamb that may be the jamb itself; parts in which a doorway is looked at
CLOSED = 0.6  # share of a doorway that obstacles cover when it is closed; a person covers less
CLOSING, CLOSING_WITHIN = 0.1, 0.5  # share by which it is covered more, and s before, while doors close
SCANS = 12  # that together show a place
ENOUGH_FREE = 0.5  # of a place that was seen free
OBSTACLE_CELLS = 2  # of a place, from which on it is occupied
HIDDEN_BY = 0.03  # rad beside a line of sight
NEARER = 0.1  # m that something is before what it hides


def lifts(overlays: MapOverlays) -> tuple[Zone, ...]:
    """The cabins of all lifts."""
    return overlays.zones_of(RegionType.ELEVATOR)


def lift_at(overlays: MapOverlays, x: float, y: float) -> Zone | None:
    """The lift that a place is in."""
    return next((zone for zone in lifts(overlays) if zone.contains(x, y)), None)


def nearest_lift(overlays: MapOverlays, place: Array) -> Thing | None:
    """The lift whose middle is nearest to a place, (2,), as what is seen on the map; None on a map without lifts."""
    middles = [(zone, zone.rings[0][:-1].mean(axis=0)) for zone in lifts(overlays)]
    zone, middle = min(middles, key=lambda found: math.dist(found[1], place), default=(None, place))
    if zone is None:
        return None
    x, y = middle.round(3).tolist()
    return Thing(role="seen", kind="lift", name=zone.name or zone.id, x=x, y=y)


def whereabouts(zone: Zone, body: Array) -> Whereabouts:
    """``body``: corners (n, 2) in the map frame."""
    inside = [zone.contains(float(x), float(y)) for x, y in body]
    return "inside" if all(inside) else "in_doorway" if any(inside) else "outside"


def is_in_lift(overlays: MapOverlays, body: Array) -> bool:
    """Whether the whole body, corners (n, 2) in the map frame, is in the cabin of a lift."""
    return any(whereabouts(zone, body) == "inside" for zone in lifts(overlays))


def with_doors(zone: Zone) -> Array:
    """A convex polygon about a cabin and its doors, (n, 2), counter-clockwise."""
    ring = zone.rings[0]
    return expanded(ring[ConvexHull(ring).vertices], DOOR_REACH)


@dataclass(frozen=True)
class Doorway:
    """``middle``: where the path crosses it. ``along``: unit vector to the left of one who enters. ``left``, ``right``:
    metres from the middle to the jambs."""

    middle: Array
    along: Array
    left: float
    right: float

    @property
    def into(self) -> Array:
        """Unit vector into the cabin."""
        return np.array([self.along[1], -self.along[0]])

    def covered(self, points: Array) -> float:
        """The share (0 to 1) of the doorway in which points of a scan, (n, 2) in the map frame, are."""
        u, v = (points - self.middle) @ self.along, (points - self.middle) @ self.into
        first, last = -self.right + JAMB, self.left - JAMB
        there = (v > -DOOR_REACH) & (v < DOOR_BEHIND) & (u > first) & (u < last)
        parts = max(round((last - first) / BIN), 1)
        hit = np.clip(((u[there] - first) / (last - first) * parts).astype(int), 0, parts - 1)
        return len(np.unique(hit)) / parts

    def is_before(self, point: Array) -> bool:
        """Whether a point, (2,), is in front of the doorway: the cabin is in sight from there."""
        return bool(-self.right <= (point - self.middle) @ self.along <= self.left)

    def has_begun(self, body: Array) -> bool:
        """Whether a corner of the body, (n, 2), is between the doors."""
        u, v = (body - self.middle) @ self.along, (body - self.middle) @ self.into
        return bool(((v > -DOOR_FACE) & (v < DOOR_BEHIND) & (u > -self.right) & (u < self.left)).any())


class DoorWatch:
    """Whether a door is closed or closing: how far it covers the doorway, scan by scan."""

    def __init__(self) -> None:
        self._seen: list[tuple[int, float]] = []

    def take(self, stamp: int, covered: float) -> None:
        """``covered`` in the scan of ``stamp`` (ns)."""
        if self._seen and self._seen[-1][0] == stamp:
            return
        begin = stamp - round(CLOSING_WITHIN * NANOSECONDS)
        self._seen = [row for row in self._seen if begin <= row[0] < stamp] + [(stamp, covered)]

    @property
    def is_closed(self) -> bool:
        return bool(self._seen) and self._seen[-1][1] >= CLOSED

    @property
    def is_closing(self) -> bool:
        """Or something else moves into the doorway."""
        return bool(self._seen) and self._seen[-1][1] >= min(covered for _, covered in self._seen) + CLOSING


def find_doorway(static: StaticMap, zone: Zone, path: Array) -> Doorway | None:
    """Where a path, rows x, y, yaw, first enters a zone; None if it does not."""
    inside = [zone.contains(float(x), float(y)) for x, y, _ in path]
    first = next((k for k in range(1, len(path)) if inside[k] and not inside[k - 1]), None)
    if first is None:
        return None
    before, after = path[first - 1, :2], path[first, :2]
    middle = 0.5 * (before + after)
    along = _side_near(zone.rings[0], middle)
    if float(np.array([along[1], -along[0]]) @ (after - before)) < 0.0:
        along = -along
    left, right = (_jamb(static, middle, along, side) for side in (1.0, -1.0))
    return Doorway(middle, along, left, right)


def doorway_in_sight(static: StaticMap, zone: Zone, start: Array, place: Array) -> Doorway | None:
    """Where the straight line from ``start`` to a place in a zone, (2,) each, enters it; None if a mapped obstacle is
    on the line."""
    g, way = static.geometry, place - start
    shares = np.linspace(0.0, 1.0, max(math.ceil(2.0 * math.hypot(*way) / g.resolution), 1) + 1)
    line = start + shares[:, None] * way
    cells = [g.cell(x, y) for x, y in line.tolist()]
    if any(static.occupied[cell] for cell in cells if 0 <= cell[0] < g.rows and 0 <= cell[1] < g.columns):
        return None
    return find_doorway(static, zone, np.column_stack([line, np.full(len(line), math.atan2(way[1], way[0]))]))


def _side_near(ring: Array, point: Array) -> Array:
    """Unit vector along that side of a closed ring (n, 2) that is nearest to a point."""
    sides = np.diff(ring, axis=0)
    lengths = np.hypot(*sides.T)
    start, sides, lengths = ring[:-1][lengths > 0.0], sides[lengths > 0.0], lengths[lengths > 0.0]
    share = np.clip(np.sum((point - start) * sides, axis=1) / lengths**2, 0.0, 1.0)
    nearest = int(np.hypot(*(start + share[:, None] * sides - point).T).argmin())
    unit: Array = sides[nearest] / lengths[nearest]
    return unit


def _jamb(static: StaticMap, middle: Array, along: Array, side: float) -> float:
    """Metres to the first mapped obstacle beside the way through a doorway."""
    g, into = static.geometry, np.array([along[1], -along[0]])
    depths = np.arange(-DOOR_REACH, DOOR_BEHIND, 0.5 * g.resolution)
    for u in np.arange(0.0, WIDEST, 0.5 * g.resolution):
        places = middle + side * u * along + depths[:, None] * into
        cells = [g.cell(x, y) for x, y in places.tolist()]
        if any(static.occupied[cell] for cell in cells if 0 <= cell[0] < g.rows and 0 <= cell[1] < g.columns):
            return float(u)
    return WIDEST


def point_state(costmap: LocalCostmap, seen: SeenScan, chassis: Pose, footprint: Footprint, place: Pose) -> PointState:
    """Of the place of the footprint at a pose in the map, by about a second of scans. What is under the chassis itself
    is free."""
    g = costmap.static.geometry
    cells = costmap.observed.unmapped_cells(cells_in(g, transformed(place, footprint.polygon)))
    if len(cells) == 0:
        return "unknown"
    occupied, free = costmap.observed.survey(cells, SCANS)
    own = inside_convex(transformed(chassis, footprint.polygon), g.centres(cells))
    if np.count_nonzero(occupied & ~own) >= OBSTACLE_CELLS:
        return "occupied"
    shown = free | own
    if shown.mean() >= ENOUGH_FREE:
        return "free"
    hits = costmap.observed.points[costmap.observed.unmapped]
    hidden = _hidden(g.centres(cells[~shown]), compose(seen.chassis, seen.sensor), hits)
    return "obscured" if hidden.mean() > 0.5 else "unknown"


def _hidden(places: Array, sensor: Pose, hits: Array) -> NDArray[np.bool_]:
    """Which of the places, (n, 2), are behind one of the hits, (m, 2), as seen from the lidar."""
    if len(hits) == 0:
        return np.zeros(len(places), dtype=np.bool_)
    at, by = places - sensor[:2], hits - sensor[:2]
    off = np.arctan2(at[:, 1], at[:, 0])[:, None] - np.arctan2(by[:, 1], by[:, 0])
    beside = np.abs((off + math.pi) % math.tau - math.pi) < HIDDEN_BY
    before = np.hypot(*by.T) < np.hypot(*at.T)[:, None] - NEARER
    behind: NDArray[np.bool_] = (beside & before).any(axis=1)
    return behind


def hiding(costmap: LocalCostmap, sensor: Pose, place: Array) -> Thing | None:
    """What hides a place, (2,) in the map frame, from the lidar at ``sensor``: the nearest hit of the newest scan that
    is before it in the line of sight; None where there is none."""
    hits = costmap.observed.points
    before = np.array([_hidden(place[None], sensor, hit[None])[0] for hit in hits], dtype=np.bool_)
    if not before.any():
        return None
    away = np.where(before, np.hypot(*(hits - sensor[:2]).T), np.inf)
    k = int(away.argmin())
    x, y = hits[k].round(3).tolist()
    if costmap.observed.unmapped[k]:
        return thing_at(costmap, x, y)
    return Thing(role="blocks", kind="mapped obstacle", x=x, y=y)


def standing_in(costmap: LocalCostmap, footprint: Footprint, place: Pose) -> Thing | None:
    """What is in the place of the footprint at a pose, by the hits of the newest scan that no map has; None where there
    are none."""
    hits = costmap.observed.points[costmap.observed.unmapped]
    inside = hits[inside_convex(transformed(place, footprint.polygon), hits)]
    if not len(inside):
        return None
    x, y = inside.mean(axis=0).round(3).tolist()
    found = thing_at(costmap, x, y)
    return found if found.kind == "moving obstacle" else found.model_copy(update={"kind": "observed obstacle"})
