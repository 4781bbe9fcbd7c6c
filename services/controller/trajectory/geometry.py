"""Paths through waypoints: legs, and blends that round their corners.

The path parameter s is the length of the polyline *without* its blends, so a blend changes nothing but its own stretch
[S−r, S+r] about the corner at S, and appending waypoints changes nothing before the last corner's blend.

A blend starts as the incoming leg and ends as the outgoing one. Seen from its corner,

    x(s) = a(s) t₁ + b(s) t₂,   b = 2r (u³ − u⁴/2),   a = (s − S) − b,   u = (s − S + r) / 2r,

is the quintic with the legs' positions, slopes and zero curvature at its ends: twice continuously differentiable. At
its middle it is 3r/16·|t₂ − t₁| away from the corner, which is the deviation a tolerance bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.arrays import Array
from rackhand.schemas.orientation import quaternion
from rackhand.services.controller.trajectory.curve import JointCurve
from rackhand.services.controller.trajectory.model import Placement, TcpPose

ANGLE_LENGTH = 0.3
"""Metres of path that a radian of pure rotation counts as: about what a wrist takes as long for."""

_SAME_DIRECTION = 1e-9
_SHORTEST_BLEND = 1e-4
_SAME_KNOT = 1e-9


@dataclass(frozen=True)
class Tolerance:
    """How far blends may pass by the waypoints: rad in every joint, m and rad at the TCP. 0 stops at each."""

    joint: float = 0.05
    position: float = 0.01
    angle: float = 0.05


@dataclass(frozen=True)
class Legs:
    """Straight legs with unit directions (k, d) between ``s`` (k+1,); ``radius`` (k+1,) of the blends at their ends.

    A ``stop`` (k+1,) is a corner too sharp to be driven through: it is taken at rest.
    """

    s: Array
    direction: Array
    radius: Array
    stop: NDArray[np.bool_]

    def blend(self, s: float) -> tuple[int, Array, Array]:
        """The waypoint that ``s`` belongs to, and a, a′, a″ and b, b′, b″ seen from it."""
        corner = int(np.argmin(np.abs(self.s - s)))
        d, r = s - self.s[corner], self.radius[corner]
        if abs(d) >= r:
            leg = np.array([d, 1.0, 0.0])
            still = np.zeros(3)
            before = d < 0 or (d == 0 and corner == self.s.size - 1)
            return (corner, leg, still) if before else (corner, still, leg)
        u = (d + r) / (2 * r)
        out = np.array([2 * r * u**3 * (1 - u / 2), u * u * (3 - 2 * u), 3 * u * (1 - u) / r])
        return corner, np.array([d - out[0], 1 - out[1], -out[2]]), out

    def first_needed(self, s: float) -> int:
        """The last waypoint whose blend ends at or before ``s``: what is before it no longer matters from ``s`` on."""
        return max(0, min(int(np.searchsorted(self.s + self.radius, s, side="right")) - 1, self.s.size - 2))

    def without(self, first: int) -> Legs:
        """From waypoint ``first`` on, whose own blend is over."""
        radius, stop = self.radius[first:].copy(), self.stop[first:].copy()
        radius[0], stop[0] = 0.0, False
        return Legs(self.s[first:], self.direction[first:], radius, stop)


def legs(lengths: Array, directions: Array, reach: Array, start: float = 0.0) -> Legs:
    """Legs of the given lengths; ``reach`` (k+1,) is the blend radius that the tolerance allows at each waypoint."""
    s = start + np.concatenate([[0.0], np.cumsum(lengths)])
    radius = np.zeros(s.size)
    radius[1:-1] = np.minimum(reach[1:-1], 0.5 * np.minimum(lengths[:-1], lengths[1:]))
    turn = np.zeros(s.size)
    turn[1:-1] = np.abs(np.diff(directions, axis=0)).max(axis=1, initial=0.0)
    stop = (turn > _SAME_DIRECTION) & (radius < _SHORTEST_BLEND * np.maximum(1.0, turn))
    radius[stop | (turn <= _SAME_DIRECTION)] = 0.0
    return Legs(s, directions, radius, stop)


def extended(old: Legs, more: Legs, reach: float, free: float) -> Legs:
    """``old``, then ``more``, which begins where ``old`` ends, with a blend between the two.

    ``reach`` is the radius its tolerance allows, ``free`` the length before the corner that is still to be driven. The
    blend takes at most half of either leg; nothing else of ``old`` changes.
    """
    turn = float(np.abs(more.direction[0] - old.direction[-1]).max())
    r = min(reach, 0.5 * float(more.s[1] - more.s[0]), 0.5 * float(old.s[-1] - old.s[-2]), free)
    straight = turn <= _SAME_DIRECTION
    stop = not straight and r < _SHORTEST_BLEND * max(1.0, turn)
    r = 0.0 if stop or straight else r
    return Legs(
        np.concatenate([old.s, more.s[1:]]),
        np.concatenate([old.direction, more.direction]),
        np.concatenate([old.radius[:-1], [r], more.radius[1:]]),
        np.concatenate([old.stop[:-1], [stop], more.stop[1:]]),
    )


@dataclass(frozen=True)
class JointPath:
    """A polyline of joint positions (k+1, n) with its corners rounded."""

    points: Array
    legs: Legs

    def curve(self) -> JointCurve:
        """The path as Hermite pieces: exact, for a blend *is* the quintic between its ends."""
        knots: list[tuple[float, Array, Array]] = []
        layout = self.legs
        for i, (s, q) in enumerate(zip(layout.s, self.points, strict=True)):
            into, out = layout.direction[max(i - 1, 0)], layout.direction[min(i, len(layout.direction) - 1)]
            r = layout.radius[i]
            if r > 0:
                # Where the blends of a short leg meet, their ends are one knot.
                meets = int(bool(knots) and s - r - knots[-1][0] < _SAME_KNOT)
                knots += [*[(s - r, q - r * into, into)][meets:], (s + r, q + r * out, out)]
            else:
                knots += [(s, q, into), (s, q, out)] if layout.stop[i] else [(s, q, out)]
        s_knots, q_knots, dq_knots = zip(*knots, strict=True)
        q_rows = np.array(q_knots)
        return JointCurve(np.array(s_knots), q_rows, np.array(dq_knots), np.zeros_like(q_rows))

    def from_(self, s: float) -> JointPath:
        """Without the waypoints that no longer matter from ``s`` on."""
        first = self.legs.first_needed(s)
        return JointPath(self.points[first:], self.legs.without(first))

    def extended(self, more: JointPath, tolerance: Tolerance, free: float) -> JointPath:
        """Goes on as ``more``, which begins where this ends; the corner is blended within ``free`` before it."""
        turn = np.abs(more.legs.direction[0] - self.legs.direction[-1]).max()
        points = np.concatenate([self.points, more.points[1:]])
        return JointPath(points, extended(self.legs, more.legs, float(_reach(tolerance.joint, turn)), free))


def joint_path(points: Array, tolerance: Tolerance, start: float = 0.0) -> JointPath:
    """Waypoints (k+1, n), rad, without duplicates; s is the Euclidean length in rad, beginning at ``start``."""
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    directions = steps / lengths[:, None]
    reach = np.full(len(points), np.inf)
    reach[1:-1] = _reach(tolerance.joint, np.abs(np.diff(directions, axis=0)).max(axis=1, initial=0.0))
    return JointPath(points, legs(lengths, directions, reach, start))


@dataclass(frozen=True)
class TaskState:
    """A pose on a task path with its twist and the twist's derivative, (6,) each: linear, angular, base axes."""

    pose: TcpPose
    twist: Array
    accel: Array


@dataclass(frozen=True)
class TaskPath:
    """Straight lines and constant turns between poses, both blended by the same a(s), b(s).

    ``points`` are the waypoints; of a leg, ``legs.direction`` (k, 6) holds d(position)/ds in base axes and the rate of
    rotation per s in the TCP's axes.
    """

    points: tuple[TcpPose, ...]
    legs: Legs

    def at(self, s: float) -> TaskState:
        """The pose, and its first and second derivative by s."""
        i, a, b = self.legs.blend(s)
        into = self.legs.direction[max(i - 1, 0)]
        out = self.legs.direction[min(i, len(self.legs.direction) - 1)]
        corner = self.points[i]
        position = corner.translation + a[0] * into[:3] + b[0] * out[:3]
        first, then = rotation_exp(a[0] * into[3:]), rotation_exp(b[0] * out[3:])
        # R = R_i exp(a w₁) exp(b w₂), and exp(b w₂) leaves w₂ where it is.
        w1, w2 = into[3:], first @ out[3:]
        omega = corner.rotation @ (a[1] * w1 + b[1] * w2)
        alpha = corner.rotation @ (a[2] * w1 + b[2] * w2 + a[1] * b[1] * np.cross(w1, w2))
        return TaskState(
            TcpPose(position, corner.rotation @ first @ then),
            np.concatenate([a[1] * into[:3] + b[1] * out[:3], omega]),
            np.concatenate([a[2] * into[:3] + b[2] * out[:3], alpha]),
        )

    def from_(self, s: float) -> TaskPath:
        """Without the waypoints that no longer matter from ``s`` on."""
        first = self.legs.first_needed(s)
        return TaskPath(self.points[first:], self.legs.without(first))

    def extended(self, more: TaskPath, tolerance: Tolerance, free: float) -> TaskPath:
        """Goes on as ``more``, which begins where this ends; the corner is blended within ``free`` before it."""
        reach = float(_task_reach(tolerance, more.legs.direction[:1] - self.legs.direction[-1:])[0])
        return TaskPath(self.points + more.points[1:], extended(self.legs, more.legs, reach, free))

    def breaks(self) -> Array:
        """Every s at which a leg or a blend begins or ends, ascending."""
        s, r = self.legs.s, self.legs.radius
        every = np.sort(np.concatenate([s[r == 0], s - r, s + r]).clip(s[0], s[-1]))
        return np.asarray(every[np.append(np.diff(every) > _SAME_KNOT, True)])


def task_path(points: Sequence[Placement], tolerance: Tolerance, start: float = 0.0) -> TaskPath:
    """Waypoints as poses, without duplicates; s is metres, a radian counting as ``ANGLE_LENGTH`` metres."""
    poses = tuple(TcpPose(np.asarray(p.translation, float), np.asarray(p.rotation, float)) for p in points)
    steps = np.array([pose_step(a, b) for a, b in pairwise(poses)])
    lengths = step_length(steps)
    directions = steps / lengths[:, None]
    turn = np.diff(directions, axis=0)
    reach = np.full(len(poses), np.inf)
    reach[1:-1] = _task_reach(tolerance, turn)
    return TaskPath(poses, legs(lengths, directions, reach, start))


def pose_step(a: Placement, b: Placement) -> Array:
    """(6,) from pose a to b: position in base axes, rotation vector in the axes of a."""
    return np.concatenate([b.translation - a.translation, rotation_log(a.rotation.T @ b.rotation)])


def step_length(steps: Array) -> Array:
    """Length in s of pose steps (k, 6)."""
    return np.asarray(
        np.hypot(np.linalg.norm(steps[:, :3], axis=1), ANGLE_LENGTH * np.linalg.norm(steps[:, 3:], axis=1))
    )


def rotation_exp(vector: Array) -> Array:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = float(np.sqrt(vector @ vector))
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-8:
        return np.asarray(np.eye(3) + cross + 0.5 * cross @ cross)
    sine, versine = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross))


def rotation_log(rotation: Array) -> Array:
    """Rotation vector, length in [0, π], of a rotation matrix."""
    w, *vector = quaternion(rotation)
    size = float(np.linalg.norm(vector))
    scale = 2 * np.arctan2(size, w) / size if size > 1e-12 else 2.0
    return np.asarray(scale * np.array(vector))


def _task_reach(tolerance: Tolerance, turn: Array) -> Array:
    """Blend radii for changes of direction ``turn`` (k, 6)."""
    return np.minimum(
        _reach(tolerance.position, np.linalg.norm(turn[:, :3], axis=1)),
        # exp on SO(3) brings nothing further apart, so |w₂ − w₁| bounds the angle between two turns.
        _reach(tolerance.angle, np.linalg.norm(turn[:, 3:], axis=1)),
    )


def _reach(tolerance: float, turn: Array | float) -> Array:
    """Blend radius whose deviation 3r/16·turn is ``tolerance``."""
    return np.asarray(16 * tolerance / (3 * np.maximum(turn, 1e-12)))
