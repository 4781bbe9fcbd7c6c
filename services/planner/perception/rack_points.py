"""Which rack points of the map are occupied, judged from the scans on the way.

A point is occupied when a rack is known there, or when anything solid is inside the outline that the largest kind of
rack would have there. It is free only when beams have passed through nearly all of that outline a moment ago.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.maps import PointType
from rackhand.schemas.racks import Occupancy, RackLevel, RackPoint, RackSpec, RackStates
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.cells import cells_in
from rackhand.services.planner.geometry.polygon import convex_overlap
from rackhand.services.planner.map.grid import StaticMap
from rackhand.services.planner.map.overlays import PointOfInterest
from rackhand.services.planner.perception.racks import RackTracker, RackView
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]
Cells = NDArray[np.int64]

LOOK_EVERY, LOOK_AT = 6, 1  # scans
WINDOW = 12  # scans (1 s) that a cell's state counts as seen now
FREE_SHARE = 0.93  # of the outline's cells, seen free, from which on the point is free
STANDS_AT = 0.5  # m from a point, within which a rack stands at it
STILL_SEEN = 1.5  # s since a rack was seen, within which it counts as seen now


@dataclass
class _Place:
    """A rack point and the outline of the largest rack there: corners (4, 2) and cells of the map."""

    point: PointOfInterest
    outline: Array
    cells: Cells
    now: Occupancy = "unknown"
    known: Occupancy = "unknown"
    stamp: int = 0


class RackPoints:
    """``look`` at each scan. States are those of level 0: a 2-D lidar sees no others."""

    def __init__(self, static: StaticMap, settings: NavigationSettings) -> None:
        self._static, self._settings = static, settings
        self._scans = 0
        self._specs: tuple[RackSpec, ...] = ()
        self._places: list[_Place] = []

    def look(self, view: RackView, racks: RackTracker) -> None:
        """Take a scan that ``racks`` has just taken."""
        self._scans += 1
        if self._scans % LOOK_EVERY != LOOK_AT:
            return
        if self._specs != view.specs:
            self._places, self._specs = self._laid_out(view), view.specs
        for place in self._places:
            place.now = self._state(place, view, racks)
            if place.now != "unknown":
                place.known, place.stamp = place.now, view.stamp
            elif view.stamp - place.stamp > self._settings.rack_memory * NANOSECONDS:
                place.known = "unknown"

    def state(self, poi_id: str, since: int = 0) -> Occupancy:
        """What was seen of a point last, if it was at the stamp ``since`` (ns) or later; ``unknown`` also for a point
        that is not on the map."""
        found = (place.known for place in self._places if place.point.id == poi_id and place.stamp >= since)
        return next(found, "unknown")

    def seen_now(self, poi_id: str) -> Occupancy:
        """What the last scans show of a point."""
        return next((place.now for place in self._places if place.point.id == poi_id), "unknown")

    def detected(self, stamp: int, map_uid: str) -> RackStates:
        """The points that the last scans show."""
        shown = [_row(p.point.id, p.now, p.stamp) for p in self._places if p.now != "unknown"]
        return RackStates(stamp=stamp, map_uid=map_uid, racks=tuple(shown))

    def remembered(self, stamp: int, map_uid: str) -> RackStates:
        """All points of the map, with what was seen of them last and when."""
        rows = [_row(place.point.id, place.known, place.stamp) for place in self._places]
        return RackStates(stamp=stamp, map_uid=map_uid, racks=tuple(rows))

    # -- one point ---------------------------------------------------------------------------------------------------

    def _laid_out(self, view: RackView) -> list[_Place]:
        """What is remembered is kept where only the kinds of racks have changed."""
        before = {place.point.id: place for place in self._places}
        outline = largest_outline(view.specs)
        places = []
        for point in self._static.overlays.points_of(PointType.RACK):
            there = se2.transformed(np.array([point.x, point.y, point.yaw or 0.0]), outline)
            cells = view.observed.unmapped_cells(cells_in(self._static.geometry, there))
            place = _Place(point, there, cells)
            if (old := before.get(point.id)) is not None:
                place.known, place.stamp = old.known, old.stamp
            places.append(place)
        return places

    def _state(self, place: _Place, view: RackView, racks: RackTracker) -> Occupancy:
        x, y = place.point.x, place.point.y
        rack = racks.near(x, y, STANDS_AT)
        if rack is not None and view.stamp - rack.stamp < STILL_SEEN * NANOSECONDS:
            return "occupied"
        if convex_overlap(view.outline, place.outline):
            return "unknown"  # the chassis itself is in the way
        if math.hypot(x - view.sensor[0], y - view.sensor[1]) > self._settings.rack_range:
            return "unknown"
        occupied, free = view.observed.survey(place.cells, WINDOW)
        if occupied.any():
            return "occupied"
        return "free" if free.size and free.mean() >= FREE_SHARE else "unknown"


def largest_outline(specs: Iterable[RackSpec]) -> Array:
    """Corners (4, 2) of the smallest rectangle, in the frame of a rack, that holds the outline of each kind."""
    corners = np.vstack([np.zeros((1, 2)), *(spec.outline() for spec in specs)])
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return np.array([(x1, y1), (x0, y1), (x0, y0), (x1, y0)])


def _row(poi_id: str, state: Occupancy, stamp: int) -> RackPoint:
    return RackPoint(poi_id=poi_id, levels=(RackLevel(stamp=stamp, state=state),))
