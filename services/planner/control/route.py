"""A plan being driven: where on it the chassis is, what is left of it, and where it is blocked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.services.planner.control.pursuit import Tracker
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.planning.distance_grid import DistanceGrid, clearance
from rackhand.services.planner.planning.plan import Plan

Array = NDArray[np.float64]
OVERLAP = 0.2  # of a cell, by which the footprint may overlap a blocked one: scan noise moves observed cells that much


class Route:
    """One tracker a segment of the plan, in order; the last one ends at the goal."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.trackers = [Tracker(segment) for segment in plan.segments]
        self._at = 0

    @property
    def current(self) -> Tracker:
        return self.trackers[self._at]

    @property
    def is_last(self) -> bool:
        return self._at == len(self.trackers) - 1

    def advance(self) -> None:
        self._at += 1

    def left(self, pose: Pose) -> float:
        """Metres of path left."""
        return self.current.left(pose) + sum(t.segment.length for t in self.trackers[self._at + 1 :])

    def ahead(self) -> Array:
        """Rows x, y, yaw from here on."""
        first = self.current.segment.points[self.current.index :]
        return np.vstack([first, *(t.segment.points for t in self.trackers[self._at + 1 :])])

    def free_distance(self, costmap: LocalCostmap, footprint: Footprint, reach: float) -> tuple[float, Array]:
        """Metres of path ahead along which the footprint is free (infinite if all of ``reach`` is), and the point (2,)
        where it is not."""
        points = self.ahead()
        free, index = first_blocked(costmap.near, footprint, points, reach)
        return float(free), points[index, :2]


@compiled
def first_blocked(grid: DistanceGrid, footprint: Footprint, points: Array, reach: float) -> tuple[float, int]:
    """Metres of path to the first of the rows x, y, yaw that is blocked, and its index; infinite and 0 for none."""
    travelled = 0.0
    for k in range(len(points)):
        x, y, yaw = points[k]
        if k > 0:
            travelled += np.hypot(x - points[k - 1, 0], y - points[k - 1, 1])
        if travelled > reach:
            break
        if clearance(grid, footprint, x, y, yaw, 0.0) < -OVERLAP * grid.geometry.resolution:
            return travelled, k
    return np.inf, 0
