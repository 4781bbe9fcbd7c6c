"""Driving onto a dock along its axis, and off it again: the law, and the dock's pose from many scans.

Poses of the chassis are in the frame of the goal: its origin where the chassis is when it is docked, x along the
chassis' heading there. So a chassis that drives forward onto the dock comes from negative x, backward from positive x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rackhand.schemas.base import Twist2
from rackhand.services.planner.control.pursuit import approach_speed
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import STANDSTILL, Pose, wrap
from rackhand.services.planner.settings import NavigationSettings

LATERAL_GAIN = 2.5  # 1/m: on the way the lateral error falls by a factor e each 0.4 m
STEEPEST = 0.35  # rad between the heading and the axis at most
STRAIGHT_WITHIN = 0.25  # m before the goal from which on the heading fades to that of the goal
TURN_GAIN = 2.5  # 1/s
FASTEST_TURN, SLOWEST_TURN = 0.6, 0.015  # rad/s
TURN_FIRST = 0.25  # rad off the wanted heading from which on it turns on the spot
STOP_WITHIN = 0.002  # m before the goal at which the chassis is stopped; it rolls out by about that at a creep
ASIDE = 0.05  # m of lateral error from which on it drives slowly
SLOW = 0.15  # m/s
MOST_BEYOND = 0.008  # m beyond the goal from which it is driven back

BLEND = 0.25  # least weight of a new sighting
JUMP, JUMP_YAW = 0.04, math.radians(3)  # off the estimate from which on a sighting is doubted
JUMPS = 3  # doubted sightings in a row after which the dock, or the chassis, was moved


class FusedPose:
    """The pose of a thing at rest in the odometry frame, from sightings in scans: first their mean, later a low-pass.

    ``pose`` is None before the first. ``sightings`` counts those since the estimate began, anew after a jump.
    """

    def __init__(self) -> None:
        self.pose: Pose | None = None
        self.sightings = 0
        self._doubted = 0

    def update(self, seen: Pose) -> None:
        """Take one sighting."""
        if self.pose is None or self._is_other(seen):
            self.pose, self.sightings, self._doubted = np.array(seen), 1, 0
            return
        if self._doubted:
            return
        self.sightings += 1
        share = max(1.0 / self.sightings, BLEND)
        self.pose = se2.interpolate(self.pose, seen, share)

    def _is_other(self, seen: Pose) -> bool:
        """Whether so many sightings in a row are elsewhere that the estimate is void."""
        assert self.pose is not None
        away = math.hypot(seen[0] - self.pose[0], seen[1] - self.pose[1])
        doubted = away > JUMP or abs(wrap(seen[2] - self.pose[2])) > JUMP_YAW
        self._doubted = self._doubted + 1 if doubted else 0
        return self._doubted >= JUMPS


@dataclass(frozen=True)
class Funnel:
    """Where the chassis may be to drive straight onto a dock: ``aside`` metres off the axis at the entry, which is
    ``entry`` metres before the goal, and ``slope`` times the distance more before that; ``turned`` rad off it."""

    entry: float
    aside: float = 0.04
    slope: float = 0.15
    turned: float = 0.3
    turned_inside: float = 0.12

    def wider(self) -> Funnel:
        """Beyond this one an attempt is given up."""
        return replace(self, aside=2.0 * self.aside, turned=2.0 * self.turned, turned_inside=2.0 * self.turned_inside)

    def holds(self, at: Pose, direction: int) -> bool:
        """``at``: pose of the chassis in the frame of the goal; ``direction``: 1 driving forward, -1 backward."""
        before = max(-direction * at[0] - self.entry, 0.0)
        turned = self.turned if before > 0.0 else self.turned_inside
        return bool(abs(at[1]) <= self.aside + self.slope * before and abs(at[2]) <= turned)


def along_axis(at: Pose, direction: int, left: float, speed: float, s: NavigationSettings) -> Twist2:
    """Follow the axis in ``direction`` (1 forward, -1 backward) for ``left`` metres more, and stop there.

    The wanted heading points at the axis: ψ = -direction·atan(k·y), so that the lateral error y falls exponentially
    with the distance; towards the end it fades to the heading of the axis.
    """
    fade = min(max(left / STRAIGHT_WITHIN, 0.0), 1.0)
    wanted = -direction * fade * min(max(math.atan(LATERAL_GAIN * at[1]), -STEEPEST), STEEPEST)
    error = wrap(wanted - at[2])
    rate = min(FASTEST_TURN, s.control.max_angular_velocity)
    angular = min(max(TURN_GAIN * error, -rate), rate)
    if abs(error) > TURN_FIRST:
        return Twist2(linear=0.0, angular=angular)
    limit = s.control.max_forward_velocity if direction > 0 else -s.control.max_backward_velocity
    limit = min(limit, speed, SLOW if abs(at[1]) > ASIDE else math.inf)
    linear = direction * min(limit, approach_speed(left, s.approach_decel, s.actuation.lag))
    return Twist2(linear=linear, angular=angular)


def approach(at: Pose, direction: int, speed: float, s: NavigationSettings) -> Twist2:
    """Drive to the goal, or back to it from just beyond."""
    left = -direction * at[0]
    if left >= 0.0:
        return along_axis(at, direction, left, speed, s)
    return along_axis(at, -direction, -left, speed, s)


def has_arrived(at: Pose, direction: int) -> bool:
    """Whether the chassis is to stop now: at the goal, or a little beyond."""
    return -MOST_BEYOND <= -direction * float(at[0]) <= STOP_WITHIN


def turn_to_axis(at: Pose) -> Twist2:
    """A slow turn on the spot to the heading of the goal, which ends at rest."""
    error = -at[2]
    if error == 0.0:
        return STANDSTILL
    return Twist2(linear=0.0, angular=math.copysign(min(max(abs(1.5 * error), SLOWEST_TURN), FASTEST_TURN), error))
