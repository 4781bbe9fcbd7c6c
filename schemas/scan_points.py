"""The hits of a lidar in the map frame: one rule for which pose belongs to a scan, and the points themselves."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np

from rackhand.schemas.base import NANOSECONDS, Pose2
from rackhand.schemas.chassis import LocalisedPose, Scan

MAX_GAP_NS = NANOSECONDS // 2
KNOWN_POSES = 8


class ScanPairing:
    """Finds the pose at which a scan was taken, whichever of the two arrives first.

    A pair is complete as soon as a pose of the scan's stamp or later is known. The pose is interpolated between the
    last one before and the first one after the scan; with a pose of exactly its stamp, it is that one. Without a pose
    before it, the one after it counts if it is within ``MAX_GAP_NS``; a gap larger than that gives no pair.
    """

    def __init__(self) -> None:
        self._poses: deque[LocalisedPose] = deque(maxlen=KNOWN_POSES)
        self._waiting: Scan | None = None

    def add_pose(self, pose: LocalisedPose) -> tuple[Scan, Pose2] | None:
        """Returns the scan that this pose completes, if one waits for it, with its pose."""
        if self._poses and pose.stamp < self._poses[-1].stamp:  # the clock was reset
            self._poses.clear()
        self._poses.append(pose)
        return self._complete()

    def add_scan(self, scan: Scan) -> tuple[Scan, Pose2] | None:
        """Returns the scan with its pose if that is known already; else it waits, in place of an older one."""
        self._waiting = scan
        return self._complete()

    def _complete(self) -> tuple[Scan, Pose2] | None:
        scan = self._waiting
        if scan is None or not self._poses or self._poses[-1].stamp < scan.stamp:
            return None
        self._waiting = None
        after = next(pose for pose in self._poses if pose.stamp >= scan.stamp)
        before = next((pose for pose in reversed(self._poses) if pose.stamp <= scan.stamp), after)
        if after.stamp - min(before.stamp, scan.stamp) > MAX_GAP_NS:
            return None
        return scan, interpolate(before, after, scan.stamp)


def interpolate(before: LocalisedPose, after: LocalisedPose, stamp: int) -> Pose2:
    """The pose at ``stamp`` between two: linear in position and, along the shorter turn, in yaw."""
    span = after.stamp - before.stamp
    if span == 0:
        return after.pose
    share = (stamp - before.stamp) / span
    a, b = before.pose, after.pose
    turn = math.remainder(b.yaw - a.yaw, math.tau)
    yaw = b.yaw if share == 1 else math.remainder(a.yaw + share * turn, math.tau)
    return Pose2(x=a.x + share * (b.x - a.x), y=a.y + share * (b.y - a.y), yaw=yaw)


def scan_points(scan: Scan, robot: Pose2) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Map-frame hits (n, 2), in metres, of a scan taken at pose ``robot``; beams without a return are left out."""
    hits = np.flatnonzero(np.isfinite(scan.ranges))
    ranges = scan.ranges[hits].astype(np.float64)
    cos, sin = math.cos(robot.yaw), math.sin(robot.yaw)
    x = robot.x + cos * scan.sensor.x - sin * scan.sensor.y
    y = robot.y + sin * scan.sensor.x + cos * scan.sensor.y
    angles = robot.yaw + scan.sensor.yaw + scan.angle_min + scan.angle_step * hits
    return np.column_stack([x + ranges * np.cos(angles), y + ranges * np.sin(angles)])
