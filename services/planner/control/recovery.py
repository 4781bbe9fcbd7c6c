"""Straight back or ahead to where there is room: where the braking guard lets nothing pass, or for somebody's sake.

Plans and paths ask for the clearance that the guard asks for, but they know obstacles as cells and the guard knows the
hits themselves; and what comes near a chassis at rest asks nobody. So it happens that no wanted twist passes though
there is free floor before or behind.
"""

from __future__ import annotations

import math

import numpy as np

from rackhand.schemas.base import NANOSECONDS, Twist2
from rackhand.services.planner.control.goal_checker import is_still
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import STANDSTILL, Pose
from rackhand.services.planner.perception.local_costmap import LocalCostmap

HELD = 0.8  # s at rest against the guard, from which on it will not pass
DISTANCE, LEAST, STEP = 0.3, 0.05, 0.025  # m: to go, worth going, between the poses that are looked at
OUT_OF_WAY = 1.0  # m to go for somebody
SPEED, SLOWEST = 0.12, 0.04  # m/s
SLOWER = 2.0  # times as long as that takes, until it ends
GIVEN = 0.003  # m of clearance that may be lost on the way: the accuracy of a clearance
MOVER_NEAR = 1.5  # m; what moves that near is waited for


class Recovery:
    """Asked once a tick while a route is driven."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Nothing is held, nothing goes on."""
        self._held_since: int | None = None
        self._from: Pose | None = None
        self._until, self._length = 0, 0.0

    def is_held(self, stamp: int) -> bool:
        """Whether the guard has kept the chassis at rest for ``HELD``."""
        return self._held_since is not None and stamp - self._held_since >= HELD * NANOSECONDS

    def watch(self, stamp: int, twist: Twist2, vetoed: bool) -> None:
        """What became of the last wanted twist; ``twist`` is the measured one."""
        if not (vetoed and is_still(twist)):
            self._held_since = None
        elif self._held_since is None:
            self._held_since = stamp

    @property
    def runs(self) -> bool:
        return self._from is not None

    def begin(
        self, stamp: int, pose: Pose, costmap: LocalCostmap, footprint: Footprint, distance: float = DISTANCE
    ) -> bool:
        """Choose the direction with more room, of up to ``distance`` metres; backward where both have the same. False
        where neither has any, or where something moves nearby."""
        movers = costmap.movers.rows()
        if len(movers) and np.hypot(*(movers[:, :2] - pose[:2]).T).min() < MOVER_NEAR:
            return False
        back, ahead = (room(costmap, footprint, pose, sign, distance) for sign in (-1.0, 1.0))
        if max(back, ahead) < LEAST:
            return False
        self._from, self._length = pose.copy(), ahead if ahead > back else -back
        self._until, self._held_since = stamp + round(SLOWER * distance / SPEED * NANOSECONDS), None
        return True

    def command(self, stamp: int, pose: Pose, vetoed: bool) -> Twist2 | None:
        """The twist of this tick; None when it is done, or goes no further."""
        assert self._from is not None
        gone = math.hypot(pose[0] - self._from[0], pose[1] - self._from[1])
        left = abs(self._length) - gone
        if left <= 0.0 or stamp >= self._until or (self.is_held(stamp) and vetoed):
            self.restart()
            return None
        speed = min(SPEED, max(left, SLOWEST))
        return STANDSTILL if left <= 0.005 else Twist2(linear=math.copysign(speed, self._length), angular=0.0)


def room(costmap: LocalCostmap, footprint: Footprint, pose: Pose, sign: float, distance: float) -> float:
    """Metres, up to ``distance``, that are free straight ahead (``sign`` 1) or behind (-1), without coming any nearer
    to what is near already."""
    margin = costmap.settings.path_margin
    need = min(costmap.near.clearance(footprint, pose, margin) - GIVEN, margin)
    for k in range(1, round(distance / STEP) + 1):
        away = sign * k * STEP
        place = np.array([pose[0] + away * math.cos(pose[2]), pose[1] + away * math.sin(pose[2]), pose[2]])
        if costmap.near.clearance(footprint, place, margin) < need:
            return (k - 1) * STEP
    return distance
