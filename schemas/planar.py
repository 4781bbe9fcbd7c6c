"""Poses in the plane, one convention for all services.

A pose is x, y in metres and yaw in radians, counter-clockwise from +x; any indexable of three numbers is taken, a tuple
is returned. ``compose(a, b)`` is the transform product T_a·T_b, ``between(a, b)`` is T_a⁻¹·T_b. Yaw is normalised to
(-π, π], the range of ``atan2``.
"""

from __future__ import annotations

import math
from typing import Protocol

from rackhand.schemas.base import Pose2, Quaternion

PlanarPose = tuple[float, float, float]


class PoseLike(Protocol):
    """Anything indexable that holds x, y, yaw: a tuple, a list, an array of shape (3,)."""

    def __getitem__(self, index: int, /) -> float: ...


def as_tuple(pose: Pose2) -> PlanarPose:
    """The numbers of a pose message."""
    return pose.x, pose.y, pose.yaw


def wrap(angle: float) -> float:
    """The same angle in (-π, π], up to rounding. Plain arithmetic, so that numba compiles it too."""
    wrapped = math.pi - (math.pi - angle) % (2.0 * math.pi)
    return wrapped if wrapped > -math.pi else math.pi


def transform(pose: PoseLike, x: float, y: float) -> tuple[float, float]:
    """The point (x, y) of the pose's frame, in the frame the pose is given in."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return pose[0] + c * x - s * y, pose[1] + s * x + c * y


def compose(a: PoseLike, b: PoseLike) -> PlanarPose:
    """The pose ``b``, given in the frame of ``a``, in the parent frame of ``a``."""
    x, y = transform(a, b[0], b[1])
    return x, y, wrap(a[2] + b[2])


def between(a: PoseLike, b: PoseLike) -> PlanarPose:
    """The pose ``b`` in the frame of ``a``; both are given in the same frame."""
    c, s = math.cos(a[2]), math.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    return c * dx + s * dy, -s * dx + c * dy, wrap(b[2] - a[2])


def yaw_quaternion(yaw: float) -> Quaternion:
    """The rotation by ``yaw`` about z as a unit quaternion w, x, y, z."""
    return math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)
