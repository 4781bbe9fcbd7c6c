"""A plan being driven: where on it the chassis is, what is left of it, and what lies in its way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.services.planner.control.pursuit import Tracker
from rackhand.services.planner.geometry.footprint import Footprint, clearance
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.planning.field import Field
from rackhand.services.planner.planning.plan import Plan

Array = NDArray[np.float64]


class Route:
    """Its trackers one after the other; the last one ends at the goal."""

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

    def free_distance(self, around: LocalCostmap, footprint: Footprint, reach: float) -> tuple[float, Array]:
        """Metres of path ahead along which the body is free (infinite if all of ``reach`` is), and where it is not."""
        near, g = around.near.distance, around.near.geometry
        points = self.ahead()
        free, index = _first_blocked(
            near, g.x, g.y, g.resolution, footprint.samples, footprint.circumscribed, points, reach
        )
        return float(free), points[index, :2]


@compiled
def _first_blocked(
    distance: Field, x0: float, y0: float, resolution: float, samples: Array, circumscribed: float, points: Array,
    reach: float,
) -> tuple[float, int]:  # fmt: skip
    travelled = 0.0
    for k in range(len(points)):
        if k > 0:
            travelled += np.hypot(points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1])
        if travelled > reach:
            break
        pose = points[k]
        if (
            clearance(distance, x0, y0, resolution, samples, circumscribed, pose[0], pose[1], pose[2], 0.0)
            < -0.2 * resolution
        ):
            return travelled, k
    return np.inf, 0
