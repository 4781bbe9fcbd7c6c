"""Poses in the plane as (3,) arrays x, y, yaw; the conventions are those of ``rackhand.schemas.planar``."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import inlined
from rackhand.schemas import planar
from rackhand.schemas.base import Pose2, Twist2

Pose = NDArray[np.float64]
STANDSTILL = Twist2(linear=0.0, angular=0.0)

wrap = inlined(planar.wrap)
"""``planar.wrap``, callable from compiled functions too."""


def pose(value: Pose2) -> Pose:
    return np.array([value.x, value.y, value.yaw])


def message(value: Pose) -> Pose2:
    return Pose2(x=float(value[0]), y=float(value[1]), yaw=float(value[2]))


def as_tuple(value: Pose) -> planar.PlanarPose:
    """As models keep it."""
    return float(value[0]), float(value[1]), float(value[2])


def compose(a: Pose, b: Pose) -> Pose:
    """T_a·T_b: the pose ``b``, given in the frame of ``a``, in the parent frame of ``a``."""
    return np.array(planar.compose(a, b))


def between(a: Pose, b: Pose) -> Pose:
    """T_a⁻¹·T_b: the pose ``b`` in the frame of ``a``."""
    return np.array(planar.between(a, b))


def interpolate(a: Pose, b: Pose, fraction: float) -> Pose:
    """The pose a ``fraction`` of the movement from ``a`` to ``b``: x and y linear, yaw along the shorter arc."""
    yaw = planar.wrap(a[2] + fraction * planar.wrap(b[2] - a[2]))
    return np.array([a[0] + fraction * (b[0] - a[0]), a[1] + fraction * (b[1] - a[1]), yaw])


def advanced(pose: Pose, twist: Twist2, seconds: float) -> Pose:
    """Where a body twist, kept for so long, takes a chassis."""
    yaw = pose[2] + 0.5 * twist.angular * seconds
    step = twist.linear * seconds
    return np.array([pose[0] + step * math.cos(yaw), pose[1] + step * math.sin(yaw), pose[2] + twist.angular * seconds])


def transformed(frame: Pose, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points, (n, 2) in the frame of ``frame``, in its parent frame."""
    c, s = math.cos(frame[2]), math.sin(frame[2])
    moved: NDArray[np.float64] = points @ np.array([(c, s), (-s, c)]) + frame[:2]
    return moved
