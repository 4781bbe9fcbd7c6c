"""Planar poses: from ground truth, and how far apart they are."""

from __future__ import annotations

import math

from rackhand.schemas.base import Pose2, Quaternion
from rackhand.schemas.world import ObjectPose


def planar(thing: ObjectPose) -> Pose2:
    """Position (m) and heading (rad) of a thing, in the map frame."""
    return Pose2(x=thing.position[0], y=thing.position[1], yaw=heading(thing.orientation))


def heading(orientation: Quaternion) -> float:
    """The yaw (rad) of a unit quaternion w, x, y, z: the first angle of its z-y-x decomposition."""
    w, x, y, z = orientation
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def distance(pose: Pose2, x: float, y: float) -> float:
    """From a pose to a point of the map, in metres."""
    return math.hypot(pose.x - x, pose.y - y)


def turn(a: float, b: float) -> float:
    """The angle between two headings, in radians, 0 … π."""
    return abs(math.remainder(a - b, math.tau))
