"""Moves of other types along a given route: the route first, then the drive to the goal."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.approach import approach
from rackhand.services.planner.behaviors.drive_to_pose import DriveToPose
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import wrap
from rackhand.services.planner.planning.goals import Goal
from tests.planner.behaviors.test_along_given_route import drive, fails_before_moving
from tests.planner.plant import Hall, Plant, Robot

Begin = Callable[..., tuple[Robot, Plant]]
ROUTE = np.array([(2.0, 4.0), (5.0, 4.0), (5.0, 7.0)])
TEXT = ", ".join(f"{x}, {y}" for x, y in ROUTE)


def start(robot: Robot, **more: Any) -> None:
    goal = {"target_x": 8.0, "target_y": 7.0, "target_ori": 1.0, "route_coordinates": TEXT}
    robot.begin(MoveCreate(**{"type": "standard"} | goal | more))


def test_without_a_route_it_is_the_plain_drive() -> None:
    assert isinstance(approach(Goal(1.0, 2.0), MoveCreate(type="charge")), DriveToPose)
    assert isinstance(approach(Goal(1.0, 2.0), MoveCreate(type="charge", route_coordinates="")), DriveToPose)
    with pytest.raises(MoveFailed, match="expected an even count"):
        approach(Goal(1.0, 2.0), MoveCreate(type="charge", route_coordinates="1, 2, 3"))


def test_a_standard_move_takes_its_route_and_then_its_target(begin: Begin) -> None:
    robot, plant = begin(Hall(10, 9))
    start(robot)
    ticks = drive(robot, ROUTE, 90)
    assert ticks[-1][2].arrived and plant.contacts == []
    assert math.dist(plant.pose[:2], (8.0, 7.0)) < 0.05 and abs(wrap(plant.pose[2] - 1.0)) < math.radians(2.0)
    assert [count for count, _ in itertools.groupby(points for points, _, _ in ticks)] == [0, 1, 2, 3]
    assert max(off for points, off, _ in ticks if 0 < points < 3) < 0.03
    assert robot.motion.move is not None
    target = robot.motion.move.status().target
    assert target is not None and (target.x, target.y, target.yaw) == (8.0, 7.0, 1.0)


def test_a_hold_on_the_route_and_one_after_it(begin: Begin) -> None:
    robot, plant = begin(Hall(10, 9))
    start(robot)
    for points in (1, 3):
        while not (robot.motion.move is not None and robot.motion.move.status().passed_points >= points):
            plant.drive(robot.tick().twist)
        for _ in range(50):
            plant.drive(robot.hold())
    assert drive(robot, ROUTE, 60)[-1][2].arrived


def test_a_goal_that_cannot_be_is_named_before_a_wheel_turns(begin: Begin) -> None:
    robot, _ = begin(Hall(10, 9))
    start(robot, target_x=50.0)
    fails_before_moving(robot, Reason.ENDING_POINT_OUT_OF_MAP)
    start(robot, route_coordinates="7, 4, 8, 4")
    fails_before_moving(robot, Reason.TOO_FAR_FROM_START_OF_TRACK)
