"""Moves of other types along a given route: the route first, then the drive to the goal."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.along_given_route import AlongRoute
from rackhand.services.planner.behaviors.approach import RouteFirst, approach
from rackhand.services.planner.behaviors.base import Context, Done, Drive, Status
from rackhand.services.planner.behaviors.docking import Docking
from rackhand.services.planner.behaviors.drive_to_pose import DriveToPose
from rackhand.services.planner.behaviors.rack_area import RackArea
from rackhand.services.planner.behaviors.registry import BEHAVIORS
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import STANDSTILL, wrap
from rackhand.services.planner.load import Load, LoadState
from rackhand.services.planner.planning.given_route import parse_route
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


@pytest.mark.parametrize(
    ("fields", "then"),
    [
        ({"type": "charge"}, Docking),
        ({"type": "align_with_rack", "target_x": 1.0, "target_y": 1.0}, Docking),
        ({"type": "align_with_rack", "rack_area_id": "a"}, RackArea),
        ({"type": "to_unload_point", "rack_area_id": "a"}, RackArea),
    ],
)
def test_what_docks_and_works_in_an_area_takes_its_route_first(fields: dict[str, Any], then: type) -> None:
    make = BEHAVIORS[fields["type"]]
    assert isinstance(make(MoveCreate(**fields)), then)
    behavior = make(MoveCreate(**fields, route_coordinates=TEXT, detour_tolerance=0.5))
    assert isinstance(behavior, RouteFirst) and isinstance(behavior._then, then)
    with pytest.raises(MoveFailed, match="expected an even count"):
        make(MoveCreate(**fields, route_coordinates="1, 2, 3"))


class Waits:
    """Stands still, and is done where the chassis is docked; ``checked`` counts how often it was asked."""

    checked = 0

    def check(self, ctx: Context) -> None:
        del ctx
        self.checked += 1

    def stays_docked(self, ctx: Context) -> bool:
        return ctx.load.state is LoadState.UNDER_RACK

    def step(self, ctx: Context) -> Drive | Done:
        return Done() if ctx.load.state is LoadState.UNDER_RACK else Drive(STANDSTILL)

    def resume(self, ctx: Context) -> None:
        """Nothing to resume."""

    def status(self) -> Status:
        return Status(intent="waits")


def test_a_chassis_that_is_docked_there_already_does_not_drive_the_route() -> None:
    then = Waits()
    behavior = RouteFirst(AlongRoute(parse_route(TEXT)), then, then.check)
    free: Any = SimpleNamespace(load=Load())
    docked: Any = SimpleNamespace(load=Load(state=LoadState.UNDER_RACK))
    assert behavior.stays_docked(docked) and not behavior.stays_docked(free)
    assert isinstance(behavior.step(docked), Done) and then.checked == 1
    assert behavior.status().intent == "waits"
