"""Following a target: where it is between two reports of it, and how fast to go after it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import NANOSECONDS, Twist2
from rackhand.services.planner.control.pursuit import approach_speed
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.perception.chassis_state import Followed
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]
SMOOTHING = 0.5  # weight of the newest difference in the velocity of the target
LONGEST_GAP = 1.5  # s between two reports, beyond which they tell no velocity
FASTEST = 4.0  # m/s; a target that was reported to be faster has jumped
FORESEEN = 0.6  # s that a report is extrapolated by
AT_REST = 0.1  # m/s
# m from a target near a wall, in which a place to drive to is looked for: one to turn at not behind the wall
SNAP, TURNING_SNAP = 1.0, 0.6


class TargetEstimate:
    """Position and velocity of a target, from its reports."""

    def __init__(self) -> None:
        self._stamp = 0
        self._position: Array | None = None
        self.velocity = np.zeros(2)

    def take(self, followed: Followed) -> None:
        """Use a report; the same one twice changes nothing."""
        if followed.target.position is None or followed.stamp == self._stamp:
            return
        position = np.array(followed.target.position)
        seconds = (followed.stamp - self._stamp) / NANOSECONDS
        if self._position is None or seconds > LONGEST_GAP:
            self.velocity = np.zeros(2)
        else:
            measured = (position - self._position) / seconds
            jumped = math.hypot(*measured) > FASTEST
            self.velocity = np.zeros(2) if jumped else self.velocity + SMOOTHING * (measured - self.velocity)
        self._stamp, self._position = followed.stamp, position

    def at(self, stamp: int) -> Array | None:
        """Where it is at ``stamp`` (2,), in metres; None before the first report of a position."""
        if self._position is None:
            return None
        age = min(max((stamp - self._stamp) / NANOSECONDS, 0.0), FORESEEN)
        there: Array = self._position + self.velocity * age
        return there

    @property
    def is_at_rest(self) -> bool:
        return math.hypot(*self.velocity) < AT_REST


def following_speed(left: float, away: float, s: NavigationSettings) -> float:
    """m/s after a target that is ``left`` metres of path ahead and goes away along it at ``away`` m/s.

    The speed of the target, corrected in proportion to the error of the distance, and never more than from which the
    chassis can brake to the wanted distance.
    """
    error = left - s.follow_distance
    wanted = away + s.follow_gain * error
    if error > 0.0:
        wanted = min(wanted, max(away, 0.0) + approach_speed(error, s.approach_decel, s.actuation.lag))
    return min(max(wanted, 0.0), s.control.max_forward_velocity)


def limited_to(twist: Twist2, speed: float) -> Twist2:
    """The same arc at ``speed`` (m/s) at most; a turn on the spot as it is."""
    if abs(twist.linear) <= speed or twist.linear == 0.0:
        return twist
    share = speed / abs(twist.linear)
    return Twist2(linear=twist.linear * share, angular=twist.angular * share)


def bearing_error(pose: Pose, target: Array) -> float:
    """Angle to turn by to face the target, in radians."""
    return wrap(math.atan2(target[1] - pose[1], target[0] - pose[0]) - pose[2])


def place_to_drive_to(target: Array, mapped: DistanceGrid, footprint: Footprint, margin: float) -> Array | None:
    """The target itself where the inscribed circle is free on the map; else the nearest point where the chassis can
    turn, or failing that where the circle is free, (2,). None for none nearby. ``margin``: clearance in metres."""
    least = footprint.inscribed + margin
    if mapped.at(target[0], target[1]) >= least:
        return target
    place = _nearest(target, mapped, footprint.circumscribed + margin, TURNING_SNAP)
    return place if place is not None else _nearest(target, mapped, least, SNAP)


def _nearest(target: Array, mapped: DistanceGrid, room: float, reach: float) -> Array | None:
    """The centre of the nearest cell within ``reach`` metres that is ``room`` metres from anything blocked."""
    g = mapped.geometry
    row, column = g.cell(target[0], target[1])
    span = math.ceil(reach / g.resolution)
    r0, c0 = max(row - span, 0), max(column - span, 0)
    window = mapped.distance[r0 : max(row + span + 1, 0), c0 : max(column + span + 1, 0)]
    rows, columns = np.nonzero(window - 0.5 * g.resolution >= room)
    if not len(rows):
        return None
    x = g.x + (columns + c0 + 0.5) * g.resolution
    y = g.y + (rows + r0 + 0.5) * g.resolution
    away = np.hypot(x - target[0], y - target[1])
    best = int(away.argmin())
    return np.array([x[best], y[best]]) if away[best] <= reach else None
