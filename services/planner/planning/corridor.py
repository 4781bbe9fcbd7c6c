"""A corridor about a line: where the origin of the chassis may be while it goes round what blocks the line."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled_nogil
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.field import Field

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Corridor:
    """Points (n, 2) of a polyline in the map frame, and how far from it the chassis' origin may be, in metres."""

    line: Array
    width: float

    def narrowed(self, grid: DistanceGrid, inscribed: float) -> DistanceGrid:
        """``grid`` for a circle of the radius ``inscribed`` whose centre stays in the corridor.

        The clearance of the circle is at most the distance of its centre to the corridor's edge, so a planner that
        weighs clearance keeps to the line where it can.
        """
        line = np.ascontiguousarray(self.line)
        return DistanceGrid(_narrowed(grid.distance, grid.geometry, line, self.width, inscribed), grid.geometry)

    def kept(self, rows: Array) -> Array:
        """Rows x, y, yaw with those outside the corridor moved to its edge.

        A search over cells lets its path leave the corridor by half a cell at most; for a line in steps as small as a
        cell, the nearest of its points is as good as the nearest place on it.
        """
        moved = rows.copy()
        to_line = moved[:, None, :2] - self.line[None, :, :]
        away = np.hypot(to_line[..., 0], to_line[..., 1])
        nearest = away.argmin(axis=1)
        off = away[np.arange(len(moved)), nearest]
        outside = off > self.width
        base = self.line[nearest[outside]]
        moved[outside, :2] = base + (moved[outside, :2] - base) * (self.width / off[outside])[:, None]
        return moved


@compiled_nogil
def _narrowed(distance: Field, geometry: Geometry, line: Array, width: float, inscribed: float) -> Field:
    rows, columns = distance.shape
    resolution = geometry.resolution
    narrow = np.zeros((rows, columns), dtype=np.float32)
    for k in range(len(line) - 1):
        ax, ay, bx, by = line[k, 0], line[k, 1], line[k + 1, 0], line[k + 1, 1]
        dx, dy = bx - ax, by - ay
        squared = max(dx * dx + dy * dy, 1e-12)
        i0 = max(math.floor((min(ay, by) - width - geometry.y) / resolution), 0)
        i1 = min(math.floor((max(ay, by) + width - geometry.y) / resolution), rows - 1)
        j0 = max(math.floor((min(ax, bx) - width - geometry.x) / resolution), 0)
        j1 = min(math.floor((max(ax, bx) + width - geometry.x) / resolution), columns - 1)
        for i in range(i0, i1 + 1):
            y = geometry.y + (i + 0.5) * resolution
            for j in range(j0, j1 + 1):
                x = geometry.x + (j + 0.5) * resolution
                t = min(max(((x - ax) * dx + (y - ay) * dy) / squared, 0.0), 1.0)
                room = width - math.hypot(x - ax - t * dx, y - ay - t * dy)
                if room >= 0.0:
                    free = min(float(distance[i, j]), room + 0.5 * resolution + inscribed)
                    narrow[i, j] = max(float(narrow[i, j]), free)
    return narrow
