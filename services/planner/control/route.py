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
from rackhand.services.planner.planning.lattice import RELAXED_SLOPE
from rackhand.services.planner.planning.plan import Plan

Array = NDArray[np.float64]
RELAXED = 0.005  # m less than where the chassis is, or than the end has: the accuracy of a clearance


class Route:
    """One tracker a segment of the plan, in order; the last one ends at the goal."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.trackers = [Tracker(segment) for segment in plan.segments]
        self._at = 0
        # A way through a hall of 500 m has 14 000 rows, which are not copied in each tick.
        self._rows = np.vstack([segment.points for segment in plan.segments])
        self._first = 0  # row of the current segment

    @property
    def current(self) -> Tracker:
        return self.trackers[self._at]

    @property
    def is_last(self) -> bool:
        return self._at == len(self.trackers) - 1

    def advance(self) -> None:
        self._first += len(self.current.segment.points)
        self._at += 1

    def left(self, pose: Pose) -> float:
        """Metres of path left."""
        return self.current.left(pose) + sum(t.segment.length for t in self.trackers[self._at + 1 :])

    def planned(self, pose: Pose) -> float:
        """Metres of path left that are planned and not a rough guide; infinite where all of it is."""
        if self.plan.open_from is None:
            return np.inf
        if self._at >= self.plan.open_from:
            return 0.0
        later = self.trackers[self._at + 1 : self.plan.open_from]
        return self.current.left(pose) + sum(t.segment.length for t in later)

    def ahead(self) -> Array:
        """Rows x, y, yaw from here on, a view that is not to be written."""
        return self._rows[self._first + self.current.index :]

    def free_distance(self, costmap: LocalCostmap, footprint: Footprint, reach: float) -> tuple[float, Array]:
        """Metres of path ahead along which the footprint is free (infinite if all of ``reach`` is), and the point (2,)
        where it is not."""
        points = self.ahead()
        free, index = free_ahead(costmap, footprint, points, reach)
        return free, points[index, :2]


def free_ahead(costmap: LocalCostmap, footprint: Footprint, points: Array, reach: float) -> tuple[float, int]:
    """Metres along the rows x, y, yaw along which the footprint is free, infinite if all of ``reach`` is; and the row
    where it is not.

    Free is what has the clearance that the braking guard asks for. Exempt are the first and the last metre: near where
    the chassis is, little more is asked for than it has there; near the end, than the map leaves there.
    """
    margin = float(costmap.settings.path_margin)
    at_end = max(costmap.mapped.clearance(footprint, points[-1], margin), 0.0)
    free, index = first_blocked(costmap.near, footprint, points, reach, margin, at_end)
    return float(free), int(index)


@compiled
def first_blocked(
    grid: DistanceGrid, footprint: Footprint, points: Array, reach: float, margin: float, at_end: float
) -> tuple[float, int]:
    """Metres of path to the first of the rows x, y, yaw that has less than its clearance, and its index; infinite and 0
    for none. ``margin``: clearance in general, ``at_end``: what the end has, in metres."""
    travelled = 0.0
    end = points[len(points) - 1]
    at_start = clearance(grid, footprint, points[0, 0], points[0, 1], points[0, 2], margin)
    for k in range(len(points)):
        x, y, yaw = points[k]
        if k > 0:
            travelled += np.hypot(x - points[k - 1, 0], y - points[k - 1, 1])
        if travelled > reach:
            break
        near_start = at_start - RELAXED + RELAXED_SLOPE * travelled
        near_end = at_end - RELAXED + RELAXED_SLOPE * np.hypot(x - end[0], y - end[1])
        if clearance(grid, footprint, x, y, yaw, margin) < min(margin, near_start, near_end):
            return travelled, k
    return np.inf, 0
