"""Giving way: whether something that moves will come too near, and the twist that avoids it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.schemas.base import NANOSECONDS, Twist2
from rackhand.services.planner.control.mppi import Mppi
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.planning.field import Field
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]
STEP = 0.2  # s
HOLD = 0.4  # s that making way goes on after the last reason for it
LEAST_SPEED = 0.5  # m/s at which a chassis that is about to go is taken to go


class DynamicAvoidance:
    """MPPI, while something that moves will come too near."""

    def __init__(self, settings: NavigationSettings) -> None:
        self._settings = settings
        self._mppi = Mppi(settings)
        self._until = 0

    def begin(self) -> None:
        """A move begins: nothing to make way for yet."""
        self._until = 0

    def is_due(self, pose: Pose, path: Array, speed: float, movers: Array, footprint: Footprint, stamp: int) -> bool:
        """Whether a mover comes too near if the chassis stands, or goes on along ``path``; holds on for a moment."""
        if not len(movers):
            return False
        gap = min(
            least_gap(pose, path, going, movers, footprint.edges, self._settings.yield_horizon)
            for going in (0.0, max(speed, LEAST_SPEED))
        )
        if gap < self._settings.yield_distance:
            if stamp >= self._until:
                self._mppi.restart()
            self._until = stamp + int(HOLD * NANOSECONDS)
        return stamp < self._until

    def command(
        self, pose: Pose, measured: Twist2, last: Twist2, around: LocalCostmap, cost: Field, goal: Pose, body: Footprint
    ) -> Twist2:
        """The twist wanted now; arguments as of ``Mppi.command``."""
        return self._mppi.command(
            pose, measured, last, around.near, cost, around.static.geometry, goal, around.movers.rows(), body,
            around.speed_limit(pose),
        )  # fmt: skip


@compiled
def least_gap(pose: Pose, path: Array, speed: float, movers: Array, body_edges: Array, horizon: float) -> float:
    """The least distance in metres between the body and any mover within ``horizon`` seconds.

    The body goes along ``path`` (rows x, y, yaw) at ``speed``; movers (rows x, y, vx, vy, radius) go straight on.
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
        c, s = math.cos(here[2]), math.sin(here[2])
        for m in range(movers.shape[0]):
            dx, dy = movers[m, 0] + movers[m, 2] * time - here[0], movers[m, 1] + movers[m, 3] * time - here[1]
            bx, by = c * dx + s * dy, -s * dx + c * dy
            gap = -1e9
            for e in range(body_edges.shape[0]):
                gap = max(gap, body_edges[e, 0] * bx + body_edges[e, 1] * by - body_edges[e, 2])
            least = min(least, gap - movers[m, 4])
    return least
