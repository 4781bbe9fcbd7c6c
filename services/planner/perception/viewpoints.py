"""From where the chassis can look at a rack point, judged by the map and what is observed on it."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.map.grid import StaticMap
from rackhand.services.planner.map.overlays import PointOfInterest
from rackhand.services.planner.perception.local_costmap import LocalCostmap

Array = NDArray[np.float64]

DISTANCES = (2.2, 3.0, 1.6)  # m from the point
SIDES = 8  # directions in which a viewpoint may be
MOST = 4  # viewpoints that are tried


def viewpoints(
    costmap: LocalCostmap,
    footprint: Footprint,
    chassis: Pose,
    point: PointOfInterest,
    line: Array | None = None,
) -> list[tuple[float, float]]:
    """Places to look at ``point`` from, the best first: on ``line``, (n, 2), where one is given, then around the point,
    those nearest to the chassis first. The footprint fits there at any heading, and no wall is between."""
    room = footprint.circumscribed
    observed = costmap.static.geometry.centres(costmap.observed_cells())
    there = np.array([point.x, point.y])
    on_line = [] if line is None else [along(line, there)[1]]
    angles = (point.yaw or 0.0) + math.pi + np.arange(SIDES) * math.tau / SIDES
    around = [there + away * np.array([math.cos(a), math.sin(a)]) for away in DISTANCES for a in angles]
    around.sort(key=lambda place: math.hypot(*(place - chassis[:2])))
    free = [(float(x), float(y)) for x, y in [*on_line, *around] if _suits(costmap, observed, room, x, y, there)]
    return free[:MOST]


def along(line: Array, point: Array) -> tuple[float, Array]:
    """Of a polyline (n, 2) the place nearest to a point: metres along it, and x, y."""
    best, travelled = (math.inf, 0.0, line[0]), 0.0
    for start, end in itertools.pairwise(line):
        side = end - start
        length = math.hypot(*side)
        share = 0.0 if length == 0.0 else min(max(float((point - start) @ side) / length**2, 0.0), 1.0)
        place = start + share * side
        best = min(best, (math.hypot(*(point - place)), travelled + share * length, place), key=lambda row: row[0])
        travelled += length
    return best[1], best[2]


def _suits(costmap: LocalCostmap, observed: Array, room: float, x: float, y: float, there: Array) -> bool:
    """Whether a circle of radius ``room`` is free at x, y, and the place in sight from there."""
    if not costmap.static.geometry.contains(x, y) or costmap.mapped.at(x, y) <= room:
        return False
    if (np.hypot(*(observed - (x, y)).T) < room).any():
        return False
    return _in_sight(costmap.static, x, y, there)


def _in_sight(static: StaticMap, x: float, y: float, there: Array) -> bool:
    """Whether no cell that a lidar can see is on the line from x, y to a place."""
    g = static.geometry
    steps = math.ceil(math.hypot(there[0] - x, there[1] - y) / (0.5 * g.resolution)) + 1
    for share in np.linspace(0.0, 1.0, steps):
        row, column = g.cell(x + share * (there[0] - x), y + share * (there[1] - y))
        if not (0 <= row < g.rows and 0 <= column < g.columns) or static.occupied[row, column]:
            return False
    return True
