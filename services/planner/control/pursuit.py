"""Regulated pure pursuit of one segment: curvature and speed (Macenski et al. 2023)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.planning.plan import Segment
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]
SEARCH = 1.5  # m of path ahead in which the nearest point is looked for
TURN_GAIN = 2.5  # 1/s
TURN_DECEL = 1.0  # rad/s²
APPROACH_GAIN = 1.8  # 1/s
CREEP = 0.025  # m/s
SLOWEST_TURN = 0.06  # rad/s
# Of the look-ahead time, for a path to be followed closely: the least distance where there is little room, which is
# driven slowly, and enough on its open parts that the noise of the pose does not steer.
TIGHT = 0.5


@compiled
def nearest(points: Array, first: int, x: float, y: float, reach: float) -> tuple[int, float]:
    """The point nearest to x, y from index ``first`` on within ``reach`` of path, and its distance."""
    best, best_distance = first, 1e9
    travelled = 0.0
    for k in range(first, len(points)):
        if k > first:
            travelled += math.hypot(points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1])
        if travelled > reach:
            break
        away = math.hypot(points[k, 0] - x, points[k, 1] - y)
        if away < best_distance:
            best, best_distance = k, away
    return best, best_distance


@compiled
def carrot(points: Array, first: int, x: float, y: float, reach: float) -> tuple[float, float]:
    """The point of the path at ``reach`` from x, y; beyond the end, on the end's straight continuation."""
    n = len(points)
    for k in range(first, n):
        if math.hypot(points[k, 0] - x, points[k, 1] - y) >= reach:
            return points[k, 0], points[k, 1]
    k = n - 2
    while k > 0 and math.hypot(points[n - 1, 0] - points[k, 0], points[n - 1, 1] - points[k, 1]) < 0.15:
        k -= 1
    dx, dy = points[n - 1, 0] - points[k, 0], points[n - 1, 1] - points[k, 1]
    norm = math.hypot(dx, dy)
    if norm < 1e-6:
        return points[n - 1, 0], points[n - 1, 1]
    along = ((x - points[n - 1, 0]) * dx + (y - points[n - 1, 1]) * dy) / norm + reach
    return points[n - 1, 0] + max(along, 0.0) * dx / norm, points[n - 1, 1] + max(along, 0.0) * dy / norm


def lengths_left(points: Array) -> Array:
    """For each point the path length to the end."""
    steps = np.hypot(*np.diff(points[:, :2], axis=0).T)
    return np.append(np.cumsum(steps[::-1])[::-1], 0.0)


@dataclass
class Tracker:
    """Progress along one segment."""

    segment: Segment
    aligned: bool = False  # turned to the segment's first heading
    index: int = 0
    deviation: float = 0.0

    def __post_init__(self) -> None:
        self._left = lengths_left(self.segment.points)

    def update(self, pose: Pose) -> None:
        self.index, self.deviation = nearest(self.segment.points, self.index, pose[0], pose[1], SEARCH)

    @property
    def end(self) -> Pose:
        last: Pose = self.segment.points[-1]
        return last

    def left(self, pose: Pose) -> float:
        """Metres of path left, exact near the end."""
        end = self.end
        straight = math.hypot(end[0] - pose[0], end[1] - pose[1])
        return max(straight, float(self._left[self.index])) if self._left[self.index] > 0.0 else straight

    def overrun(self, pose: Pose) -> float:
        """Metres beyond the line through the end square to the direction of travel (negative before it)."""
        end = self.end
        ahead = -1.0 if self.segment.backward else 1.0
        return float(ahead * ((pose[0] - end[0]) * math.cos(end[2]) + (pose[1] - end[1]) * math.sin(end[2])))


def curvature(tracker: Tracker, pose: Pose, speed: float, s: NavigationSettings, tight: bool) -> tuple[float, float]:
    """Curvature (1/m, of the body's arc in its direction of travel) to the look-ahead point, and the bearing error."""
    time = s.lookahead_time * (TIGHT if tight else 1.0)
    reach = min(max(abs(speed) * time, s.min_lookahead), s.max_lookahead)
    x, y = carrot(tracker.segment.points, tracker.index, pose[0], pose[1], reach)
    yaw = pose[2] + (math.pi if tracker.segment.backward else 0.0)
    error = wrap(math.atan2(y - pose[1], x - pose[0]) - yaw)
    distance = max(math.hypot(x - pose[0], y - pose[1]), 0.05)
    return 2.0 * math.sin(error) / distance, error


def turn_rate(error: float, limit: float, decel: float = TURN_DECEL) -> float:
    """Rate of a turn on the spot that ends at rest: proportional near, braking parabola far (``decel`` in rad/s²)."""
    rate = min(limit, math.sqrt(2.0 * decel * abs(error)), TURN_GAIN * abs(error))
    return math.copysign(max(rate, SLOWEST_TURN), error)


def approach_speed(left: float, decel: float, lag: float) -> float:
    """Speed from which a stop after ``left`` metres is smooth; creeps at the very end.

    The chassis goes on for ``lag`` s before it brakes: v·lag + v²/2·decel = left.
    """
    left = max(left, 0.0)
    speed = math.sqrt((decel * lag) ** 2 + 2.0 * decel * left) - decel * lag
    return max(min(speed, APPROACH_GAIN * left), CREEP)


def regulated_speed(kappa: float, free: float, limit: float, s: NavigationSettings) -> float:
    """The speed that curvature (1/m) and clearance of the body (m) allow, at most ``limit``."""
    bend = abs(kappa)
    speed = limit
    if bend > 1e-6:
        speed = min(speed, math.sqrt(s.max_lateral_acc / bend), 0.8 * s.control.max_angular_velocity / bend)
    room = min(max(free / s.full_speed_clearance, 0.0), 1.0)
    allowed = s.min_clearance_velocity + room * (s.control.max_forward_velocity - s.min_clearance_velocity)
    return min(speed, allowed)
