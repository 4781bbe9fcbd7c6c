"""What to command along a route: turn to it, follow it as fast as it allows, stop where it ends."""

from __future__ import annotations

import math

from rackhand.schemas.base import Twist2
from rackhand.services.planner.control.pursuit import Tracker, approach_speed, curvature, regulated_speed, turn_rate
from rackhand.services.planner.control.route import Route
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.settings import NavigationSettings

ALIGNED = 0.04  # rad from a heading, within which the chassis is turned to it
SEGMENT_END = 0.02  # m
NEAR_END, BESIDE_END = 0.4, 0.004  # m: an end this near and this far ahead is passed
CREEPING = 0.1  # m/s and rad/s, below which the chassis may turn on the spot
WIDE_TURN = 0.3  # rad of a turn on the spot, above which the other direction of turning is considered
MIN_FREE = 0.02  # m of free path beyond the distance to keep, below which the chassis stops
MIN_BEARING_FACTOR = 0.15  # of the speed, however far the look-ahead point is to the side
LINE_KEEPING_RATE = 0.1  # rad/s; steering while driving, where turns are for standstill


def follow(
    route: Route,
    pose: Pose,
    twist: Twist2,
    free: float,
    costmap: LocalCostmap,
    footprint: Footprint,
    s: NavigationSettings,
    in_place: bool,
) -> Twist2:
    """The twist to command. ``free``: metres of path ahead that are free. ``in_place``: turn at standstill only."""
    tracker = route.current
    if not tracker.aligned:
        error = wrap(tracker.segment.points[tracker.index][2] - pose[2])
        slack = ALIGNED if in_place or route.plan.tight else s.rotate_first_angle
        if abs(error) > slack or (abs(twist.angular) > CREEPING and abs(error) > ALIGNED):
            return turn(pose, error, costmap, footprint, s)
        tracker.aligned = True
    kappa, bearing = curvature(tracker, pose, twist.linear, s, route.plan.tight)
    if abs(bearing) > s.rotate_first_angle and abs(twist.linear) < CREEPING:
        return turn(pose, bearing, costmap, footprint, s)
    limit = -s.control.max_backward_velocity if tracker.segment.backward else s.control.max_forward_velocity
    limit = min(limit, costmap.speed_limit(pose))
    speed = regulated_speed(kappa, costmap.near.clearance(footprint, pose), limit, s)
    speed = min(speed, approach_speed(tracker.left(pose), s.approach_decel, s.actuation.lag), speed_before(free, s))
    # The more the look-ahead point is to the side, the slower: most of the turn comes first.
    speed *= max(MIN_BEARING_FACTOR, math.cos(min(abs(bearing), math.pi / 2)))
    angular = speed * kappa
    if in_place:
        angular = min(max(angular, -LINE_KEEPING_RATE), LINE_KEEPING_RATE)
    return Twist2(linear=-speed if tracker.segment.backward else speed, angular=angular)


def speed_before(free: float, s: NavigationSettings) -> float:
    """The speed that keeps ``stop_before_obstacle`` when ``free`` metres of path are free; infinite for all of it."""
    if not math.isfinite(free):
        return math.inf
    left = free - s.stop_before_obstacle
    return approach_speed(left, s.approach_decel, s.actuation.lag) if left > MIN_FREE else 0.0


def turn(pose: Pose, error: float, costmap: LocalCostmap, footprint: Footprint, s: NavigationSettings) -> Twist2:
    """A turn on the spot by ``error``, in the other direction if only that is free."""
    if abs(error) > WIDE_TURN and costmap.near.turn_clearance(footprint, pose, error) < 0.0:
        other = error - math.copysign(2.0 * math.pi, error)
        if costmap.near.turn_clearance(footprint, pose, other) >= 0.0:
            error = other
    return Twist2(linear=0.0, angular=turn_rate(error, s.control.max_angular_velocity, s.turn_decel))


def has_ended(route: Route, pose: Pose, stop_within: float) -> bool:
    """Whether the end of the current segment is within ``stop_within`` metres (of the goal; ``SEGMENT_END`` of other
    ends), or passed so closely that driving on brings the chassis no nearer."""
    return is_at_end(route.current, pose, stop_within if route.is_last else SEGMENT_END)


def is_at_end(tracker: Tracker, pose: Pose, within: float) -> bool:
    """The same for one segment and a distance in metres."""
    left = tracker.left(pose)
    return left <= within or (tracker.aligned and left < NEAR_END and tracker.overrun(pose) >= -BESIDE_END)
