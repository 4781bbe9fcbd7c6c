"""Poses in the plane as (3,) arrays x, y, yaw."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import Pose2, Twist2

Pose = NDArray[np.float64]
STANDSTILL = Twist2(linear=0.0, angular=0.0)


def pose(value: Pose2) -> Pose:
    return np.array([value.x, value.y, value.yaw])


def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def compose(a: Pose, b: Pose) -> Pose:
    """b, given in the frame of a, in a's parent frame."""
    c, s = math.cos(a[2]), math.sin(a[2])
    return np.array([a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], wrap(a[2] + b[2])])


def between(a: Pose, b: Pose) -> Pose:
    """b seen from a."""
    c, s = math.cos(a[2]), math.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    return np.array([c * dx + s * dy, -s * dx + c * dy, wrap(b[2] - a[2])])


def interpolate(a: Pose, b: Pose, fraction: float) -> Pose:
    return np.array(
        [
            a[0] + fraction * (b[0] - a[0]),
            a[1] + fraction * (b[1] - a[1]),
            wrap(a[2] + fraction * wrap(b[2] - a[2])),
        ]
    )


def transformed(frame: Pose, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points, (n, 2) in the frame of ``frame``, in its parent frame."""
    c, s = math.cos(frame[2]), math.sin(frame[2])
    moved: NDArray[np.float64] = points @ np.array([(c, s), (-s, c)]) + frame[:2]
    return moved
