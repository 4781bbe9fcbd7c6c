"""Tracking a given line: the curvature that corrects the cross-track error, and the speed that keeps it small."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import Twist2
from rackhand.services.planner.control import driving
from rackhand.services.planner.control.pursuit import Tracker, approach_speed, regulated_speed
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.planning.given_route import Leg
from rackhand.services.planner.planning.plan import SPACING, Segment
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]
LATERAL_ACC = 0.3  # m/s² in the arcs of a line
RATE_SHARE = 0.8  # of the maximum angular velocity that arcs may need; the rest corrects
SHORTEST, PER_SPEED, LONGEST = 0.3, 0.5, 0.75  # m, s and m: distance within which a cross-track error is corrected
PREVIEW = 0.25  # s by which the curvature of the line is fed forward: lag, and the ramp of the turning rate
MIN_HEADING_FACTOR = 0.15  # of the speed, however far the heading is off the line's


class LineTracker:
    """Progress along one leg of a given route, and the twist that keeps the chassis on it.

    The curvature is κ = κ_line - 2·(e_yaw + atan(e_y / 2L)) / L. For small errors that is critically damped over the
    distance L, and a large cross-track error is approached at an angle below 90°. Compare the chained form of
    Samson (1995) for unicycles.
    """

    def __init__(self, leg: Leg) -> None:
        self.leg = leg
        self.tracker = Tracker(Segment(leg.rows))

    def errors(self, pose: Pose) -> tuple[float, float]:
        """Cross-track error in metres (positive: the chassis is left of the line) and heading error in radians."""
        x, y, yaw = self.tracker.segment.points[self.tracker.index]
        across = -math.sin(yaw) * (pose[0] - x) + math.cos(yaw) * (pose[1] - y)
        return across, wrap(pose[2] - yaw)

    def follow(
        self, pose: Pose, twist: Twist2, free: float, costmap: LocalCostmap, footprint: Footprint, s: NavigationSettings
    ) -> Twist2:
        """The twist to command. ``free``: metres of line ahead that are free."""
        tracker = self.tracker
        across, turned = self.errors(pose)
        if not tracker.aligned:
            if abs(turned) > driving.ALIGNED or abs(twist.angular) > driving.CREEPING:
                return driving.turn(pose, -turned, costmap, footprint, s)
            tracker.aligned = True
        if abs(turned) > s.rotate_first_angle and abs(twist.linear) < driving.CREEPING:
            return driving.turn(pose, -turned, costmap, footprint, s)
        speed = min(
            self._allowed(twist.linear, s),
            regulated_speed(
                self._curvature(0.0), costmap.near.clearance(footprint, pose),
                min(s.control.max_forward_velocity, costmap.speed_limit(pose)), s,
            ),
            approach_speed(tracker.left(pose), s.approach_decel, s.actuation.lag),
            driving.speed_before(free, s),
        ) * max(MIN_HEADING_FACTOR, math.cos(min(abs(turned), math.pi / 2)))  # fmt: skip
        reach = min(max(SHORTEST, PER_SPEED * abs(twist.linear)), LONGEST)
        kappa = self._curvature(PREVIEW * abs(twist.linear))
        kappa -= 2.0 / reach * (turned + math.atan(across / (2.0 * reach)))
        return Twist2(linear=speed, angular=speed * kappa)

    def _index(self, ahead: float) -> int:
        return min(self.tracker.index + round(ahead / SPACING), len(self.leg.rows) - 1)

    def _curvature(self, ahead: float) -> float:
        """Of the line (1/m), so many metres ahead."""
        return float(self.leg.curvature[self._index(ahead)])

    def _allowed(self, speed: float, s: NavigationSettings) -> float:
        """m/s that the arcs ahead allow, braking for each in time."""
        first = self._index(abs(speed) * (s.actuation.latency + s.actuation.lag))
        last = self._index(speed * speed / (2.0 * s.approach_decel) + 1.0)
        bends = np.maximum(np.abs(self.leg.curvature[first : max(last, first) + 1]), 1e-6)
        there = np.minimum(np.sqrt(LATERAL_ACC / bends), RATE_SHARE * s.control.max_angular_velocity / bends)
        return float(np.sqrt(there**2 + 2.0 * s.approach_decel * SPACING * np.arange(len(there))).min())
