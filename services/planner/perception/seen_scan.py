"""A scan as points, with where the chassis was when it was taken."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.chassis import Scan
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose

Array = NDArray[np.float64]


class SeenScan(NamedTuple):
    """One scan. ``points``: what returned within reach and is no part of the body, (n, 2) in the chassis frame at
    ``stamp`` (ns), in the order of the beams. ``chassis`` is the pose then in the map, ``odometry`` in its own frame.
    ``sensor`` is the lidar's pose in the chassis frame.
    """

    stamp: int
    points: Array
    chassis: Pose
    odometry: Pose
    sensor: Pose

    @property
    def in_map(self) -> Array:
        """The points in the map frame, (n, 2)."""
        return se2.transformed(self.chassis, self.points)


def points_of(scan: Scan, reach: float, body: Footprint) -> Array:
    """Points that returned within ``reach`` metres and are no part of the body, (n, 2) in the chassis frame."""
    ranges = scan.ranges.astype(np.float64)
    angles = scan.angle_min + np.arange(ranges.size) * scan.angle_step
    seen = (ranges > 0.0) & (ranges <= min(scan.range_max, reach))  # False for NaN
    beams = ranges[seen, None] * np.column_stack([np.cos(angles[seen]), np.sin(angles[seen])])
    return outside(se2.transformed(se2.pose(scan.sensor), beams), body)


def outside(points: Array, body: Footprint) -> Array:
    """Those of the points, (n, 2) in the chassis frame, that are no part of the body."""
    kept: Array = points[(points @ body.edges[:, :2].T > body.edges[:, 2]).any(axis=1)]
    return kept
