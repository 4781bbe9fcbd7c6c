"""A given route being driven: where on it the chassis is, what is left of it, and where it is blocked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import Twist2
from rackhand.services.planner.control import driving
from rackhand.services.planner.control.dynamic_avoidance import least_gap
from rackhand.services.planner.control.line_tracking import LineTracker
from rackhand.services.planner.control.route import free_ahead
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.planning.given_route import GivenRoute, legs_of

Array = NDArray[np.float64]
WAIT_GAP = 0.3  # m; a dynamic obstacle that would come nearer to the chassis on its line is waited for
WAIT_HORIZON = 2.5  # s
SLOWEST_ASSUMED = 0.3  # m/s; at rest, whether to wait is decided for this speed


class GivenLine:
    """One tracker a leg of the route, in order. ``rows``: x, y, yaw of all legs."""

    def __init__(self, route: GivenRoute) -> None:
        self.route = route
        self.trackers = [LineTracker(leg) for leg in legs_of(route)]
        self.rows = np.vstack([tracker.leg.rows for tracker in self.trackers])
        self._first_rows = np.cumsum([0, *(len(tracker.leg.rows) for tracker in self.trackers[:-1])])
        self._lengths = [tracker.tracker.segment.length for tracker in self.trackers]
        self._at = 0

    @property
    def current(self) -> LineTracker:
        return self.trackers[self._at]

    @property
    def is_last(self) -> bool:
        return self._at == len(self.trackers) - 1

    @property
    def passed(self) -> int:
        """Given points that are behind the chassis."""
        return int(self.current.leg.passed[self.current.tracker.index])

    @property
    def row(self) -> int:
        """The index of ``rows`` that the chassis has got to."""
        return int(self._first_rows[self._at]) + self.current.tracker.index

    def update(self, pose: Pose) -> None:
        self.current.tracker.update(pose)

    def has_ended(self, pose: Pose) -> bool:
        """Whether the end of the current leg is reached."""
        return driving.is_at_end(self.current.tracker, pose, driving.SEGMENT_END)

    def advance(self) -> None:
        """Go on with the next leg; it begins with a turn on the spot."""
        self._at += 1

    def left(self, pose: Pose) -> float:
        """Metres of line left."""
        return self.current.tracker.left(pose) + sum(self._lengths[self._at + 1 :])

    def ahead(self) -> Array:
        """Rows x, y, yaw from here on."""
        ahead: Array = self.rows[self.row :]
        return ahead

    def seek(self, row: int) -> None:
        """Go on from this index of ``rows``."""
        self._at = int(np.searchsorted(self._first_rows, row, side="right")) - 1
        self.current.tracker.index = row - int(self._first_rows[self._at])

    def free_distance(self, costmap: LocalCostmap, footprint: Footprint, reach: float) -> tuple[float, int]:
        """Metres of line ahead along which the footprint is free (infinite if all of ``reach`` is), and the index of
        ``rows`` at which it is not."""
        free, index = free_ahead(costmap, footprint, self.ahead(), reach)
        return free, self.row + index


def must_wait(pose: Pose, twist: Twist2, ahead: Array, movers: Array, footprint: Footprint) -> bool:
    """Whether a dynamic obstacle comes near if the chassis goes on along ``ahead`` (rows x, y, yaw), and not as near if
    it stops. ``movers``: rows x, y, vx, vy, radius."""
    if not len(movers):
        return False
    speeds = max(abs(twist.linear), SLOWEST_ASSUMED), 0.0
    going, standing = (least_gap(pose, ahead, v, movers, footprint.edges, WAIT_HORIZON) for v in speeds)
    return bool(going < WAIT_GAP and going < standing)
