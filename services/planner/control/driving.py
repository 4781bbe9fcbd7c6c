"""What to command along a route: turn to it, follow it as fast as the way allows, stop where it ends."""

from __future__ import annotations

import math

from rackhand.schemas.base import Twist2
from rackhand.services.planner.control.pursuit import approach_speed, curvature, regulated_speed, turn_rate
from rackhand.services.planner.control.route import Route
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.settings import NavigationSettings

ALIGNED = 0.04  # rad
SEGMENT_END = 0.02  # m
KEEPING_TO_LINE = 0.1  # rad/s while driving, where turning is for standstill


def follow(
    route: Route,
    pose: Pose,
    twist: Twist2,
    free: float,
    around: LocalCostmap,
    footprint: Footprint,
    s: NavigationSettings,
    in_place: bool,
) -> Twist2:
    """The twist wanted now. ``free``: metres of path ahead that are free. ``in_place``: turn at standstill only."""
    tracker = route.current
    if not tracker.aligned:
        error = wrap(tracker.segment.points[tracker.index][2] - pose[2])
        slack = ALIGNED if in_place or route.plan.tight else s.rotate_first_angle
        if abs(error) > slack or (abs(twist.angular) > 0.1 and abs(error) > ALIGNED):
            return turn(pose, error, around, footprint, s)
        tracker.aligned = True
    kappa, bearing = curvature(tracker, pose, twist.linear, s, route.plan.tight)
    if abs(bearing) > s.rotate_first_angle and abs(twist.linear) < 0.1:
        return turn(pose, bearing, around, footprint, s)
    limit = -s.control.max_backward_velocity if tracker.segment.backward else s.control.max_forward_velocity
    limit = min(limit, around.speed_limit(pose))
    speed = regulated_speed(kappa, around.near.clearance(footprint, pose), limit, s)
    speed = min(speed, approach_speed(tracker.left(pose), s.approach_decel, s.actuation.lag))
    if math.isfinite(free):
        room = free - s.stop_before_obstacle
        speed = min(speed, approach_speed(room, s.approach_decel, s.actuation.lag) if room > 0.02 else 0.0)
    ahead = -1.0 if tracker.segment.backward else 1.0
    # A body that looks elsewhere than it should go turns while it is slow.
    speed *= max(0.15, math.cos(min(abs(bearing), math.pi / 2)))
    angular = speed * kappa
    if in_place:  # what is left of turning is only to keep to the line
        angular = min(max(angular, -KEEPING_TO_LINE), KEEPING_TO_LINE)
    return Twist2(linear=ahead * speed, angular=angular)


def turn(pose: Pose, error: float, around: LocalCostmap, footprint: Footprint, s: NavigationSettings) -> Twist2:
    """Turn on the spot by ``error``, the other way round if only that is free."""
    if abs(error) > 0.3 and around.near.turn_clearance(footprint, pose, error) < 0.0:
        other = error - math.copysign(2.0 * math.pi, error)
        if around.near.turn_clearance(footprint, pose, other) >= 0.0:
            error = other
    return Twist2(linear=0.0, angular=turn_rate(error, s.control.max_angular_velocity))


def has_ended(route: Route, pose: Pose, stop_within: float) -> bool:
    """Whether the end of the current segment is reached as well as driving on can reach it."""
    tracker = route.current
    left = tracker.left(pose)
    within = stop_within if route.is_last else SEGMENT_END
    return left <= within or (tracker.aligned and left < 0.4 and tracker.overrun(pose) >= -0.004)
