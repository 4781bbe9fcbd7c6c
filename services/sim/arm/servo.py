"""The arithmetic of an arm's servo: short segments that its reference follows, and torques that hold the joints to it.

Arrays are (n,), one entry a joint: rad, rad/s, rad/s², N·m; times in seconds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled

Array = NDArray[np.float64]

# What a segment is planned for.
HOLD, POSITION, VELOCITY = 0, 1, 2
# A stream at its acceleration limit, sampled and with jitter, asks for more than the limit between two samples: of what
# changes faster than this factor allows a joint is taken to jump.
STREAM_SLACK = 4.0
# A segment to a position that needs more than so many times the limit is not driven, and the joint draws near within
# its limits: of a stream that is on time, and of what was foreseen wrongly because a command came late.
ON_TIME, LATE = 6.0, 2.5
# The servo's poles, rad/s: fast beside any motion, slow beside its period of 1 ms.
BANDWIDTH = 100.0
# A joint that is held back drags its reference along at this distance (rad), instead of winding up.
MAX_ERROR = 0.05


# Share of a joint's torque limit that the servo uses against errors of position: what presses against the arm at rest,
# or what the arm presses against, is pushed with no more than that. Motion, and damping it, may use the whole limit.
FEEDBACK_SHARE = 0.35


class JointLimits(NamedTuple):
    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    torque: Array


class Joints(NamedTuple):
    """An arm's part of the physics' own arrays. ``mass``: the lower triangle of the mass matrix, row by row."""

    position: Array
    velocity: Array
    mass: Array
    bias: Array
    passive: Array
    damping: Array


class Reference(NamedTuple):
    """What the joints are held to; written in place.

    ``position`` is where it is, ``rate`` the difference of its last two positions over time, ``held_back`` which joints
    it had to wait for. It follows a cubic from ``start``, left with the velocity ``leave``, to ``end``, reached with
    ``arrive``; beyond its end it stands. ``timing``: seconds into that segment, and its duration.
    """

    position: Array
    rate: Array
    held_back: NDArray[np.bool_]
    start: Array
    leave: Array
    end: Array
    arrive: Array
    timing: Array

    @classmethod
    def at(cls, position: Array, velocity: Array, step: float) -> Reference:
        """At this position, passed with this velocity. Nothing is planned beyond the next ``step``."""
        p, v = np.array(position, dtype=np.float64), np.array(velocity, dtype=np.float64)
        return cls(p, v, np.zeros(len(p), np.bool_), p.copy(), v.copy(), p + v * step, v.copy(), np.array([0.0, step]))

    def restart(self, position: Array, velocity: Array, step: float) -> None:
        """Become what ``at`` makes, in place."""
        for own, new in zip(self, Reference.at(position, velocity, step), strict=True):
            own[:] = new

    def has_ended(self, step: float) -> bool:
        """Whether the next ``step`` is beyond the end of the segment."""
        time, duration = self.timing
        return bool(time > duration - step / 2)


class Servo:
    """What a servo works on: arrays that stay where they are as long as the arm is there.

    ``motors``: indices of its joints' motors in ``ctrl``, the physics' own array; ``torque`` is written, and added to
    ``total``.
    """

    def __init__(
        self,
        reference: Reference,
        joints: Joints,
        limits: JointLimits,
        torque: Array,
        total: Array,
        motors: NDArray[np.int64],
        ctrl: Array,
    ) -> None:
        self._kept = (*reference, *joints, *limits, torque, total, np.ascontiguousarray(motors, np.int64), ctrl)
        for array in self._kept:
            if not array.flags.c_contiguous:
                raise ValueError(f"an array of shape {array.shape} is not contiguous")
        self.addresses = [array.ctypes.data for array in self._kept]
        self.sizes = [len(torque), len(joints.mass), len(ctrl)]


@compiled
def plan(
    reference: Reference,
    mode: int,
    values: Array,
    passing: Array,
    limits: JointLimits,
    duration: float,
    sharpest: float,
) -> None:
    """The next segment of the reference, from where it is.

    ``POSITION``: to ``values``, passed with the velocities ``passing``. Where they can be reached within the segment
    with ``sharpest`` times the acceleration limit, and the joint can then stop before the end of its range, they are;
    else it draws near what passes there within its limits of velocity and acceleration: it can always brake to the
    velocity ``passing`` when it has caught up. ``VELOCITY``: to ``values``, so that the joint can always stop before
    the end of its range. ``HOLD``: to standstill, as hard as the acceleration limits allow.
    """
    for j in range(len(reference.position)):
        p, v = reference.position[j], _velocity(reference, j)
        lower, upper, acceleration = limits.lower[j], limits.upper[j], limits.acceleration[j]
        if mode == POSITION:
            fastest = limits.velocity[j]
            p1, v1 = _towards(p, v, values[j], passing[j], lower, upper, fastest, acceleration, duration, sharpest)
        elif mode == VELOCITY:
            wanted = values[j]
            room = max(upper - p if wanted > 0 else p - lower, 0.0)
            most = _stopping_speed(room, _sign(wanted) * v, limits.velocity[j], acceleration, duration)
            # Streams are followed to the letter up to the slack; the braking before the end of the range is within it.
            p1, v1 = _accelerate(p, v, _clip(wanted, -most, most), STREAM_SLACK * acceleration, duration)
        else:
            p1, v1 = _accelerate(p, v, 0.0, acceleration, duration)
        reference.start[j], reference.leave[j], reference.end[j], reference.arrive[j] = p, v, p1, v1
    reference.timing[0], reference.timing[1] = 0.0, duration


@compiled
def stream_motion(
    values: Array, before: Array, before_slope: Array, gap: float, interval: float, apart: float, limits: JointLimits
) -> tuple[Array, Array, Array]:
    """Velocity and acceleration with which a stream of positions passes its newest ``values``, and how fast it came
    there (its slope).

    ``before`` and ``before_slope`` are those of its last positions, ``gap`` seconds earlier (0: of the same stamp);
    ``interval`` is that gap within bounds, ``apart`` how far the middles of the last two are. Both are 0 of a joint
    that jumps: one that is faster, or gains more within ``apart``, than its limits allow.
    """
    n = len(values)
    velocity, slope, acceleration = np.zeros(n), np.empty(n), np.zeros(n)
    for j in range(n):
        slope[j] = (values[j] - before[j]) / gap if gap > 0 else before_slope[j]
        gained, most = slope[j] - before_slope[j], limits.acceleration[j] * apart
        if math.isnan(gained):
            gained = 0.0
        if abs(gained) <= STREAM_SLACK * most and abs(slope[j]) <= 1.001 * limits.velocity[j]:
            acceleration[j] = _clip(gained, -most, most) / apart
            # At the end of the interval the stream is faster than on average.
            velocity[j] = slope[j] + acceleration[j] * interval / 2
    return velocity, slope, acceleration


@compiled
def extrapolate(values: Array, velocity: Array, acceleration: Array, ahead: float) -> tuple[Array, Array]:
    """Positions and velocities of a stream ``ahead`` seconds after its ``values``. What brakes is not taken to turn."""
    n = len(values)
    positions, velocities = np.empty(n), np.empty(n)
    for j in range(n):
        v, a, time = velocity[j], acceleration[j], ahead
        if v * a < 0.0:
            time = min(ahead, -v / a)
        positions[j], velocities[j] = values[j] + (v + a * time / 2) * time, v + a * time
    return positions, velocities


@compiled
def hold_to(reference: Reference, joints: Joints, limits: JointLimits, step: float, torque: Array) -> None:
    """Go one step along the reference, and write the torques that hold the joints to it into ``torque``.

    Its velocities are differences of its positions, as those of the physics. A computed-torque law: mass matrix times
    the acceleration wanted, and bias forces. The physics takes the joints' damping implicitly, as part of the mass.
    """
    n = len(torque)
    wanted, spring, pushes = np.empty(n), np.empty(n), np.empty(n)
    reference.timing[0] += step
    for j in range(n):
        at, speed = joints.position[j], joints.velocity[j]
        p, rate, planned = reference.position[j], reference.rate[j], _position(reference, j)
        p_next = _clip(planned, at - MAX_ERROR, at + MAX_ERROR)
        # The reference of a joint that is held back stands, or the joint's own shaking would drive it.
        held_back = p_next != planned
        rate_next = 0.0 if held_back else (p_next - p) / step
        acceleration = 0.0 if held_back or reference.held_back[j] else (rate_next - rate) / step
        wanted[j] = acceleration + 2 * BANDWIDTH * (rate - speed)
        spring[j] = BANDWIDTH**2 * (p - at)
        reference.position[j], reference.rate[j], reference.held_back[j] = p_next, rate_next, held_back
    _times_mass(joints.mass, wanted, torque)
    _times_mass(joints.mass, spring, pushes)
    for j in range(n):
        most = limits.torque[j]
        implicit = step * joints.damping[j]
        push = pushes[j] + implicit * spring[j]
        moves = torque[j] + implicit * wanted[j] + joints.bias[j] - joints.passive[j]
        torque[j] = _clip(moves + _clip(push, -FEEDBACK_SHARE * most, FEEDBACK_SHARE * most), -most, most)


@compiled
def let_torques(asked: Array, joints: Joints, limits: JointLimits, torque: Array) -> None:
    """Write ``asked`` on top of the bias forces into ``torque``.

    Torques know no speed: a joint that one has driven beyond its velocity limit is braked.
    """
    n = len(torque)
    braking = np.empty(n)
    for j in range(n):
        speed = joints.velocity[j]
        braking[j] = -3 * BANDWIDTH * (speed - _clip(speed, -limits.velocity[j], limits.velocity[j]))
    _times_mass(joints.mass, braking, torque)
    for j in range(n):
        most = limits.torque[j]
        torque[j] = _clip(_clip(asked[j], -most, most) + joints.bias[j] + torque[j], -most, most)


@compiled
def _times_mass(mass: Array, vector: Array, product: Array) -> None:
    """The symmetric matrix whose lower triangle is ``mass`` times the vector."""
    product[:] = 0.0
    entry = 0
    for i in range(len(vector)):
        for j in range(i):
            product[i] += mass[entry] * vector[j]
            product[j] += mass[entry] * vector[i]
            entry += 1
        product[i] += mass[entry] * vector[i]
        entry += 1


@compiled
def _position(reference: Reference, j: int) -> float:
    """Where the segment is now."""
    time, duration = reference.timing
    s = min(time / duration, 1.0)
    rise, leave, arrive = s * s * (3 - 2 * s), s * (1 - s) ** 2 * duration, s * s * (s - 1) * duration
    ends = reference.start[j] * (1 - rise) + reference.end[j] * rise
    return float(ends + reference.leave[j] * leave + reference.arrive[j] * arrive)


@compiled
def _velocity(reference: Reference, j: int) -> float:
    """The velocity of the segment now; none of a joint that is held back."""
    if reference.held_back[j]:
        return 0.0
    time, duration = reference.timing
    s = min(time / duration, 1.0)
    way = (reference.end[j] - reference.start[j]) / duration
    ends = (1 - s) * (1 - 3 * s) * reference.leave[j] + s * (3 * s - 2) * reference.arrive[j]
    return float(6 * s * (1 - s) * way + ends)


@compiled
def _towards(
    p: float,
    v: float,
    target: float,
    passing: float,
    lower: float,
    upper: float,
    fastest: float,
    acceleration: float,
    duration: float,
    sharpest: float,
) -> tuple[float, float]:
    """Position and velocity at the end of a segment on the way to ``target``."""
    target, passing = _clip(target, lower, upper), _clip(passing, -fastest, fastest)
    way = target - p
    # The cubic accelerates most at its ends.
    begins = (6 * way / duration - 4 * v - 2 * passing) / duration
    ends = (2 * v + 4 * passing - 6 * way / duration) / duration
    at_hand = max(abs(begins), abs(ends)) <= sharpest * acceleration and abs(way) <= fastest * duration * 1.001
    room = upper - target if passing > 0 else target - lower
    if at_hand and abs(passing) <= math.sqrt(2 * acceleration * room) + acceleration * duration:
        return target, passing
    # As one sees it who moves with what is to be caught up.
    behind = way - passing * duration
    closing = _stopping_speed(abs(behind), _sign(behind) * (v - passing), fastest, acceleration, duration)
    wanted = passing + _sign(behind) * closing
    room = max(upper - p if wanted > 0 else p - lower, 0.0)
    most = _stopping_speed(room, _sign(wanted) * v, fastest, acceleration, duration)
    if abs(wanted) > most:
        # It came to the end of the range by a stream that was followed to the letter.
        return _accelerate(p, v, _clip(wanted, -most, most), STREAM_SLACK * acceleration, duration)
    return _accelerate(p, v, wanted, acceleration, duration)


@compiled
def _accelerate(p: float, v: float, wanted: float, acceleration: float, duration: float) -> tuple[float, float]:
    """Position and velocity ``duration`` later, on the way to the velocity ``wanted``."""
    change = acceleration * duration
    v1 = v + _clip(wanted - v, -change, change)
    return p + (v + v1) / 2 * duration, v1


@compiled
def _stopping_speed(room: float, speed: float, fastest: float, acceleration: float, duration: float) -> float:
    """The greatest speed at the segment's end from which braking ends within ``room``, ``speed`` being that of now.

    From v²/2a + (speed + v)/2·T = room.
    """
    step = acceleration * duration
    below_root = max(step**2 / 4 + acceleration * (2 * room - speed * duration), 0.0)
    return _clip(math.sqrt(below_root) - step / 2, 0.0, fastest)


@compiled
def _clip(value: float, least: float, most: float) -> float:
    return min(max(value, least), most)


@compiled
def _sign(value: float) -> float:
    return 1.0 if value > 0 else -1.0 if value < 0 else 0.0
