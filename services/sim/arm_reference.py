"""The motion an arm's drives hold to: short segments from where the reference is to where a command wants it.

Pure; arrays are (n,), one entry a joint: rad, rad/s, rad/s²; times in seconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A stream of positions at its acceleration limit, sampled and with jitter, asks for more than the limit between two
# samples. Within this factor it is followed to the letter; beyond it, as a jump.
STREAM_SLACK = 4.0


@dataclass(frozen=True)
class JointLimits:
    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    torque: Array


@dataclass(frozen=True)
class Motion:
    position: Array
    velocity: Array


@dataclass(frozen=True)
class Segment:
    """The cubic from ``start`` to ``end`` within ``duration``; beyond its end it stands."""

    start: Motion
    end: Motion
    duration: float

    def position(self, time: float) -> Array:
        s = min(time / self.duration, 1.0)
        rise = s * s * (3 - 2 * s)
        leave, arrive = s * (1 - s) ** 2 * self.duration, s * s * (s - 1) * self.duration
        return (
            self.start.position * (1 - rise)
            + self.end.position * rise
            + self.start.velocity * leave
            + self.end.velocity * arrive
        )

    def velocity(self, time: float) -> Array:
        s = min(time / self.duration, 1.0)
        way = (self.end.position - self.start.position) / self.duration
        return 6 * s * (1 - s) * way + (1 - s) * (1 - 3 * s) * self.start.velocity + s * (3 * s - 2) * self.end.velocity


def towards(now: Motion, target: Array, velocity: Array, limits: JointLimits, duration: float) -> Segment:
    """On the way to ``target``, to be passed with ``velocity``.

    Where it can be reached within the segment it is; else the joint goes there within its limits of velocity and
    acceleration, and can always stop at it.
    """
    target = np.clip(target, limits.lower, limits.upper)
    velocity = np.clip(velocity, -limits.velocity, limits.velocity)
    way = target - now.position
    reach = STREAM_SLACK * limits.acceleration * duration**2 / 2
    at_hand = (np.abs(way - now.velocity * duration) <= reach) & (np.abs(way) <= limits.velocity * duration * 1.001)
    speed = _stopping_speed(np.abs(way), np.sign(way) * now.velocity, limits, duration)
    limited = _accelerate(now, np.sign(way) * speed, limits.acceleration, duration)
    end = Motion(np.where(at_hand, target, limited.end.position), np.where(at_hand, velocity, limited.end.velocity))
    return Segment(now, end, duration)


def at_velocity(now: Motion, velocity: Array, limits: JointLimits, duration: float) -> Segment:
    """On the way to ``velocity``, so that the joint can always stop before the end of its range."""
    room = np.where(velocity > 0, limits.upper - now.position, now.position - limits.lower)
    most = _stopping_speed(np.maximum(room, 0.0), np.sign(velocity) * now.velocity, limits, duration)
    wanted = np.clip(velocity, -most, most)
    # Streams are followed to the letter up to the slack; the braking before the end of the range is within it.
    return _accelerate(now, wanted, STREAM_SLACK * limits.acceleration, duration)


def braking(now: Motion, limits: JointLimits, duration: float) -> Segment:
    """Towards standstill, as hard as the acceleration limits allow."""
    return _accelerate(now, np.zeros_like(now.velocity), limits.acceleration, duration)


def _accelerate(now: Motion, wanted: Array, acceleration: Array, duration: float) -> Segment:
    change = acceleration * duration
    velocity = now.velocity + np.clip(wanted - now.velocity, -change, change)
    position = now.position + (now.velocity + velocity) / 2 * duration
    return Segment(now, Motion(position, velocity), duration)


def _stopping_speed(room: Array, speed: Array, limits: JointLimits, duration: float) -> Array:
    """The greatest speed at the segment's end from which braking ends within ``room``, ``speed`` being that of now.

    From v²/2a + (speed + v)/2·T = room.
    """
    step = limits.acceleration * duration
    below_root = np.maximum(step**2 / 4 + limits.acceleration * (2 * room - speed * duration), 0.0)
    return np.asarray(np.clip(np.sqrt(below_root) - step / 2, 0.0, limits.velocity), dtype=np.float64)
