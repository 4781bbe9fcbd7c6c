"""Dynamic avoidance: whether a dynamic obstacle will come too near, and the twist that avoids it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.schemas.base import NANOSECONDS, Twist2
from rackhand.services.planner.control.mppi import CostField, Mppi
from rackhand.services.planner.geometry.footprint import Footprint, distance_to_body
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.settings import Limits, NavigationSettings

Array = NDArray[np.float64]
STEP = 0.2  # s
HOLD = 0.4  # s that avoidance goes on after the last reason for it
MIN_SPEED = 0.5  # m/s; a chassis slower than this on its path is taken to drive this fast


class DynamicAvoidance:
    """MPPI, while a dynamic obstacle is predicted to come too near."""

    def __init__(self, settings: NavigationSettings) -> None:
        self._settings = settings
        self._mppi = Mppi(settings)
        self._until = 0

    def set_limits(self, limits: Limits) -> None:
        """What may be commanded from now on."""
        self._mppi.set_limits(limits)

    def begin(self) -> None:
        """A move begins: nothing to avoid yet."""
        self._until = 0

    def is_due(self, pose: Pose, path: Array, speed: float, obstacles: Array, footprint: Footprint, stamp: int) -> bool:
        """Whether a dynamic obstacle comes too near if the chassis stops, or if it goes on along ``path`` (rows x, y,
        yaw) at ``speed``; and for ``HOLD`` after. ``obstacles``: rows x, y, vx, vy, radius."""
        if not len(obstacles):
            return False
        gap = min(
            least_gap(pose, path, float(going), obstacles, footprint.edges, float(self._settings.yield_horizon))
            for going in (0.0, max(speed, MIN_SPEED))
        )
        if gap < self._settings.yield_distance:
            if stamp >= self._until:
                self._mppi.restart()
            self._until = stamp + int(HOLD * NANOSECONDS)
        return stamp < self._until

    def command(
        self,
        pose: Pose,
        measured: Twist2,
        last: Twist2,
        costmap: LocalCostmap,
        field: CostField,
        goal: Pose,
        footprint: Footprint,
    ) -> Twist2:
        """The twist to command; arguments as of ``Mppi.command``."""
        return self._mppi.command(
            pose, measured, last, costmap.near, field, goal, costmap.movers.rows(),
            footprint, costmap.speed_limit(pose),
        )  # fmt: skip


@compiled
def least_gap(pose: Pose, path: Array, speed: float, obstacles: Array, body_edges: Array, horizon: float) -> float:
    """The least distance in metres between the body and any dynamic obstacle within ``horizon`` seconds.

    The body goes along ``path`` (rows x, y, yaw) at ``speed``; obstacles (rows x, y, vx, vy, radius) go straight on.
    """
    least = 1e9
    index = 0
    travelled = 0.0
    here = pose.copy()
    for step in range(math.ceil(horizon / STEP) + 1):
        time = step * STEP
        while index + 1 < len(path) and travelled < speed * time:
            travelled += math.hypot(path[index + 1, 0] - path[index, 0], path[index + 1, 1] - path[index, 1])
            index += 1
            here[:] = path[index]
        for m in range(obstacles.shape[0]):
            x, y = obstacles[m, 0] + obstacles[m, 2] * time, obstacles[m, 1] + obstacles[m, 3] * time
            least = min(least, distance_to_body(body_edges, here, x, y) - obstacles[m, 4])
    return least
