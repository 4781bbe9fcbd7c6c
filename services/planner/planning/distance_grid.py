"""A distance field with its place in the map, and the clearance of a footprint in it."""

from __future__ import annotations

import math
from typing import NamedTuple

from rackhand.runtime.compiled import compiled, inlined
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.planning.field import Field, Mask, distance_field, sample

TURN_STEP = 0.08  # rad between the headings at which a turn on the spot is checked


class DistanceGrid(NamedTuple):
    """``distance``: metres from each cell's centre to the nearest blocked cell's centre, (rows, columns).

    Compiled functions take it as it is.
    """

    distance: Field
    geometry: Geometry

    @staticmethod
    def of(blocked: Mask, geometry: Geometry) -> DistanceGrid:
        return DistanceGrid(distance_field(blocked, geometry.resolution), geometry)

    def at(self, x: float, y: float) -> float:
        """Metres from a point to the edge of the nearest blocked cell."""
        return float(sample(self.distance, self.geometry, x, y)) - 0.5 * self.geometry.resolution

    def clearance(self, footprint: Footprint, pose: Pose, enough: float = 1.0) -> float:
        """Metres between the footprint at a pose and the nearest blocked cell's edge, exact below ``enough``."""
        return clearance(self, footprint, pose[0], pose[1], pose[2], enough)

    def turn_clearance(self, footprint: Footprint, pose: Pose, turn: float, enough: float = 0.0) -> float:
        """The least clearance while turning on the spot by ``turn`` (signed), exact from 0 to ``enough``.

        Below 0 it is that of the first heading that overlaps.
        """
        return turn_clearance(self, footprint, pose[0], pose[1], pose[2], turn, enough)


@inlined
def clearance(grid: DistanceGrid, footprint: Footprint, x: float, y: float, yaw: float, enough: float) -> float:
    """Metres between the footprint and the nearest blocked cell's edge; negative when they overlap.

    Stops looking when it is surely at least ``enough`` (returns at least that), or below 0 by a whole cell.
    """
    distance, geometry, samples = grid.distance, grid.geometry, footprint.samples
    half = 0.5 * geometry.resolution
    centre = sample(distance, geometry, x, y) - half
    if centre - footprint.circumscribed >= enough:
        return centre - footprint.circumscribed
    c, s = math.cos(yaw), math.sin(yaw)
    least = 1e9
    for k in range(samples.shape[0]):
        px, py = samples[k, 0], samples[k, 1]
        free = sample(distance, geometry, x + c * px - s * py, y + s * px + c * py) - half - samples[k, 2]
        if free < least:
            least = free
            if least < -geometry.resolution:
                break
    return least


@compiled
def turn_clearance(
    grid: DistanceGrid, footprint: Footprint, x: float, y: float, start: float, turn: float, enough: float
) -> float:
    """The least clearance while turning on the spot from heading ``start`` by ``turn`` (signed)."""
    n = math.ceil(abs(turn) / TURN_STEP) + 1
    least = 1e9
    for k in range(n + 1):
        free = clearance(grid, footprint, x, y, start + turn * k / n, enough)
        least = min(least, free)
        if least < enough and least < 0.0:
            break
    return least
