"""A scan as points in the chassis frame and in the map."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Scan
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.perception.seen_scan import SeenScan, points_of
from tests.planner.plant import BODY


def scan(*ranges: float) -> Scan:
    """Four beams to the front, the left, the back and the right of a lidar 0.2 m before the chassis' origin."""
    return Scan(
        stamp=1,
        sensor=Pose2(x=0.2, y=0.0, yaw=0.0),
        angle_min=0.0,
        angle_step=math.pi / 2,
        range_max=20.0,
        ranges=np.array(ranges, dtype="<f4"),
    )


def test_points_are_in_the_chassis_frame_without_the_body_and_without_what_is_too_far() -> None:
    points = points_of(scan(1.0, 0.1, math.nan, 9.0), 8.0, Footprint.of(BODY))
    assert points == pytest.approx(np.array([(1.2, 0.0)])), "0.1 m to the left is the body, 9 m is out of reach"


def test_points_in_the_map_are_seen_from_the_chassis() -> None:
    points = points_of(scan(1.0, 2.0, math.nan, math.nan), 8.0, Footprint.of(BODY))
    seen = SeenScan(1, points, np.array([5.0, 6.0, math.pi / 2]), np.zeros(3), np.zeros(3))
    assert seen.in_map == pytest.approx(np.array([(5.0, 7.2), (3.0, 6.2)]))
