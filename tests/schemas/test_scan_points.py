"""Scans and the poses at which they were taken."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import LocalisedPose, Scan
from rackhand.schemas.scan_points import MAX_GAP_NS, ScanPairing, interpolate, scan_points

MS = 1_000_000


def pose(stamp: int, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> LocalisedPose:
    return LocalisedPose(stamp=stamp, pose=Pose2(x=x, y=y, yaw=yaw), covariance=np.eye(3), quality=10)


def scan(stamp: int, sensor: Pose2 | None = None, angle_min: float = 0.0) -> Scan:
    """Hits at 2 m and 1 m, half a turn apart, and a beam without a return between them."""
    return Scan(
        stamp=stamp, sensor=sensor or Pose2(x=0.0, y=0.0, yaw=0.0), angle_min=angle_min, angle_step=math.pi / 2,
        range_max=10.0, ranges=np.array([2.0, math.nan, 1.0], "<f4"),
    )  # fmt: skip


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))), ids=str)
def test_a_scan_gets_the_pose_of_its_stamp_in_whatever_order_they_arrive(order: tuple[int, ...]) -> None:
    pairing, pairs = ScanPairing(), []
    for index in order:
        if index == 0 and order.index(1) < order.index(0):
            continue  # an older pose after a newer one is a new run
        found = [
            lambda: pairing.add_pose(pose(40 * MS, x=1.0)),
            lambda: pairing.add_pose(pose(80 * MS, x=2.0)),
            lambda: pairing.add_scan(scan(80 * MS)),
        ][index]()
        pairs += [found] if found is not None else []
    assert [(pair[0].stamp, pair[1].x) for pair in pairs] == [(80 * MS, 2.0)]


def test_between_two_poses_the_pose_is_interpolated_along_the_shorter_turn() -> None:
    pairing = ScanPairing()
    pairing.add_pose(pose(0, x=1.0, y=0.0, yaw=3.0))
    assert pairing.add_scan(scan(30 * MS)) is None
    pair = pairing.add_pose(pose(40 * MS, x=2.0, y=4.0, yaw=-3.0))
    assert pair is not None
    turn = 2 * math.pi - 6.0
    assert (pair[1].x, pair[1].y) == (1.75, 3.0)
    assert pair[1].yaw == pytest.approx(math.remainder(3.0 + 0.75 * turn, math.tau))


def test_a_pair_is_returned_once_and_only_for_the_newest_scan() -> None:
    pairing = ScanPairing()
    pairing.add_scan(scan(10 * MS))
    pairing.add_scan(scan(20 * MS))
    pair = pairing.add_pose(pose(40 * MS))
    assert pair is not None and pair[0].stamp == 20 * MS
    assert pairing.add_pose(pose(80 * MS)) is None


def test_poses_too_far_apart_give_no_pair() -> None:
    pairing = ScanPairing()
    pairing.add_pose(pose(0))
    pairing.add_scan(scan(10 * MS))
    assert pairing.add_pose(pose(MAX_GAP_NS + 1)) is None
    assert ScanPairing().add_scan(scan(0)) is None


def test_a_clock_that_was_reset_discards_the_poses_of_the_former_run() -> None:
    pairing = ScanPairing()
    pairing.add_pose(pose(5000 * MS, x=9.0))
    pairing.add_pose(pose(0, x=1.0))
    pair = pairing.add_scan(scan(0))
    assert pair is not None and pair[1].x == 1.0


def test_interpolation_ends_at_both_poses() -> None:
    a, b = pose(0, x=1.0, yaw=0.5), pose(10, x=3.0, yaw=1.5)
    assert interpolate(a, b, 0) == a.pose and interpolate(a, b, 10) == b.pose


def test_hits_are_in_the_map_frame_through_the_pose_of_the_sensor_and_of_the_robot() -> None:
    sensor = Pose2(x=0.1, y=0.0, yaw=math.pi)
    robot = Pose2(x=1.0, y=2.0, yaw=math.pi / 2)
    # The sensor faces back: its first beam goes to the robot's rear, which is the map's -y.
    assert np.allclose(scan_points(scan(0, sensor), robot), [[1.0, 0.1], [1.0, 3.1]])
    assert len(scan_points(scan(0), robot)) == 2  # the beam without a return is left out
