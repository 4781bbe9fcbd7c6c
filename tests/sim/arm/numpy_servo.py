"""The oracle of the arm's servo: the same laws written with numpy, all joints at once.

Arrays are (n,), one entry a joint: rad, rad/s, rad/s², N·m; times in seconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rackhand.services.sim.arm.servo import (
    BANDWIDTH,
    FEEDBACK_SHARE,
    MAX_ERROR,
    STREAM_SLACK,
    Array,
    JointLimits,
)


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


def towards(
    now: Motion, target: Array, velocity: Array, limits: JointLimits, duration: float, sharpest: float
) -> Segment:
    """On the way to ``target``, to be passed with ``velocity``.

    Where it can be reached within the segment it is; else the joint draws near what passes there within its limits of
    velocity and acceleration.
    """
    target = np.clip(target, limits.lower, limits.upper)
    velocity = np.clip(velocity, -limits.velocity, limits.velocity)
    way = target - now.position
    begins = (6 * way / duration - 4 * now.velocity - 2 * velocity) / duration
    ends = (2 * now.velocity + 4 * velocity - 6 * way / duration) / duration
    gentle = np.maximum(np.abs(begins), np.abs(ends)) <= sharpest * limits.acceleration
    at_hand = gentle & (np.abs(way) <= limits.velocity * duration * 1.001)
    room = np.where(velocity > 0, limits.upper - target, target - limits.lower)
    at_hand &= np.abs(velocity) <= np.sqrt(2 * limits.acceleration * room) + limits.acceleration * duration
    behind = way - velocity * duration
    closing = _stopping_speed(np.abs(behind), np.sign(behind) * (now.velocity - velocity), limits, duration)
    wanted = velocity + np.sign(behind) * closing
    left = np.maximum(np.where(wanted > 0, limits.upper - now.position, now.position - limits.lower), 0.0)
    most = _stopping_speed(left, np.sign(wanted) * now.velocity, limits, duration)
    slack = np.where(np.abs(wanted) > most, STREAM_SLACK, 1.0)
    limited = _accelerate(now, np.clip(wanted, -most, most), slack * limits.acceleration, duration)
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


class NumpyServo:
    """The reference, and the torques that hold the joints to it. It begins at rest."""

    def __init__(self, position: Array, limits: JointLimits, step: float) -> None:
        self.limits, self.step = limits, step
        self.position, self.rate = position.copy(), np.zeros_like(position)
        self.held_back = np.zeros(len(position), dtype=bool)
        self.segment = braking(Motion(self.position, self.rate), limits, step)
        self.time = 0.0

    def plan(self, mode: str, values: Array, passing: Array, duration: float, sharpest: float) -> None:
        now = Motion(self.position, np.where(self.held_back, 0.0, self.segment.velocity(self.time)))
        match mode:
            case "position":
                self.segment = towards(now, values, passing, self.limits, duration, sharpest)
            case "velocity":
                self.segment = at_velocity(now, values, self.limits, duration)
            case _:
                self.segment = braking(now, self.limits, duration)
        self.time = 0.0

    def hold_to(self, q: Array, dq: Array, mass: Array, bias: Array, passive: Array, damping: Array) -> Array:
        """``mass`` is the whole matrix, (n, n)."""
        p, v = self.position, self.rate
        self.time += self.step
        planned = self.segment.position(self.time)
        p_next = np.clip(planned, q - MAX_ERROR, q + MAX_ERROR)
        held_back = p_next != planned
        v_next = np.where(held_back, 0.0, (p_next - p) / self.step)
        acceleration = np.where(held_back | self.held_back, 0.0, (v_next - v) / self.step)
        self.position, self.rate, self.held_back = p_next, v_next, held_back
        spring, wanted = BANDWIDTH**2 * (p - q), acceleration + 2 * BANDWIDTH * (v - dq)
        moves = mass @ wanted + self.step * damping * wanted + bias - passive
        pushes = mass @ spring + self.step * damping * spring
        most, share = self.limits.torque, FEEDBACK_SHARE * self.limits.torque
        return np.asarray(np.clip(moves + np.clip(pushes, -share, share), -most, most))


def let_torques(asked: Array, dq: Array, mass: Array, bias: Array, limits: JointLimits) -> Array:
    too_fast = dq - np.clip(dq, -limits.velocity, limits.velocity)
    torque = np.clip(asked, -limits.torque, limits.torque) + bias - 3 * BANDWIDTH * mass @ too_fast
    return np.asarray(np.clip(torque, -limits.torque, limits.torque))
