"""One braking guard for every source of motion: what it lets pass can always be stopped."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.schemas.base import Twist2
from rackhand.services.planner.behaviors.base import Drive
from tests.planner.plant import Hall, Plant, Robot, box

AHEAD = Twist2(linear=1.2, angular=0.0)


def want(robot: Robot, plant: Plant, twist: Twist2, seconds: float) -> None:
    for _ in range(round(seconds / 0.04)):
        plant.drive(robot.want(twist))


@pytest.mark.parametrize("seen_by", ["map and scan", "scan without a map", "scan without a position"])
def test_driving_at_a_wall_stops_before_it(begin, seen_by: str) -> None:
    robot, plant = begin(Hall(10, 8), pose=(5.0, 4.0, 0.3))
    if seen_by == "scan without a map":
        robot.motion.set_map(None)
    plant.pose_lost = seen_by == "scan without a position"
    want(robot, plant, AHEAD, 12)
    assert plant.contacts == []
    assert abs(plant.v) < 0.02
    assert plant.pose[0] > 8.5, "it came close"


def test_a_crate_that_is_not_on_the_map_stops_it_too(begin) -> None:
    robot, plant = begin(Hall(10, 8), crates=(box(5.0, 4.0, 0.4, 0.4),))
    want(robot, plant, AHEAD, 8)
    assert plant.contacts == [] and 4.0 < plant.pose[0] < 4.5
    want(robot, plant, Twist2(linear=-0.2, angular=0.0), 3)
    assert plant.pose[0] < 4.0, "away from it is free"


@pytest.mark.parametrize("fault", ["lidar_dead", "lidar_blind"])
def test_without_a_usable_scan_nothing_drives(begin, fault: str) -> None:
    robot, plant = begin(Hall(10, 8))
    want(robot, plant, AHEAD, 2)
    assert plant.v > 0.5
    setattr(plant, fault, True)
    want(robot, plant, AHEAD, 2.5)
    assert plant.v < 0.02


def test_what_a_behaviour_may_touch_is_ignored_and_nothing_else(begin) -> None:
    crates = (box(3.5, 4.0, 0.2, 0.2), box(4.6, 4.0, 0.2, 0.2))
    robot, plant = begin(Hall(10, 8), crates=crates)
    first = np.array([(3.2, 3.7), (3.8, 3.7), (3.8, 4.3), (3.2, 4.3)])
    for _ in range(200):
        robot._measure()
        plant.drive(robot._command(Drive(AHEAD, may_touch=(first,))))
    assert {name for _, name in plant.contacts} == {"crate 0"}
    assert plant.pose[0] < 4.2


def test_a_costmap_mask_frees_what_is_inside_and_nothing_else(begin) -> None:
    crates = (box(3.5, 4.0, 0.2, 0.2), box(3.5, 5.2, 0.2, 0.2))
    robot, _ = begin(Hall(10, 8), crates=crates)
    masked = robot.costmap.mask(np.array([(3.2, 3.7), (3.8, 3.7), (3.8, 4.3), (3.2, 4.3)]))
    assert robot.costmap.near.at(3.42, 4.0) < 0.05 < 0.3 < masked.near.at(3.42, 4.0)
    assert masked.near.at(3.42, 5.12) < 0.1
    obstacles = masked.obstacles(np.array([3.0, 4.0, 0.0]))
    assert not (np.hypot(obstacles[:, 0] - 3.4, obstacles[:, 1] - 4.0) < 0.2).any()
    assert (np.hypot(obstacles[:, 0] - 3.4, obstacles[:, 1] - 5.2) < 0.2).any()
