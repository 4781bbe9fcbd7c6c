"""Clearances on a map of any size: distance fields of the parts that are asked about, made when they are."""

from __future__ import annotations

import math
from collections import OrderedDict

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.field import Mask

TILE = 4.0  # m to a side
MARGIN = 3.0  # m about a tile: distances up to this are exact
KEPT = 32  # tiles


class TiledClearance:
    """As a ``DistanceGrid`` of the whole map, exact up to ``MARGIN`` metres from the points that are looked at."""

    def __init__(self, blocked: Mask, geometry: Geometry) -> None:
        """``blocked`` must not change afterwards."""
        self._blocked, self._geometry = blocked, geometry
        self._grids: OrderedDict[tuple[int, int], DistanceGrid] = OrderedDict()

    def at(self, x: float, y: float) -> float:
        """Metres from a point to the edge of the nearest blocked cell; nothing outside the map is free."""
        return self.grid_at(x, y).at(x, y)

    def clearance(self, footprint: Footprint, pose: Pose, enough: float = 1.0) -> float:
        """As ``DistanceGrid.clearance``."""
        return self.grid_at(pose[0], pose[1]).clearance(footprint, pose, enough)

    def turn_clearance(self, footprint: Footprint, pose: Pose, turn: float, enough: float = 0.0) -> float:
        """As ``DistanceGrid.turn_clearance``."""
        return self.grid_at(pose[0], pose[1]).turn_clearance(footprint, pose, turn, enough)

    def grid_at(self, x: float, y: float) -> DistanceGrid:
        """The distances about the tile of a point; about the nearest one for a point outside the map."""
        g, size = self._geometry, max(round(TILE / self._geometry.resolution), 1)
        row, column = g.cell(x, y)
        tile = min(max(row, 0), g.rows - 1) // size, min(max(column, 0), g.columns - 1) // size
        if tile not in self._grids:
            self._grids[tile] = self._cut(tile, size)
            if len(self._grids) > KEPT:
                self._grids.popitem(last=False)
        self._grids.move_to_end(tile)
        return self._grids[tile]

    def _cut(self, tile: tuple[int, int], size: int) -> DistanceGrid:
        g, margin = self._geometry, math.ceil(MARGIN / self._geometry.resolution)
        r0, c0 = (max(index * size - margin, 0) for index in tile)
        r1, c1 = ((index + 1) * size + margin for index in tile)
        part = self._blocked[r0:r1, c0:c1]
        return DistanceGrid.of(part, Geometry(*_corner(g, r0, c0), g.resolution, *part.shape))


def _corner(g: Geometry, row: int, column: int) -> tuple[float, float]:
    return g.x + column * g.resolution, g.y + row * g.resolution
