"""A localised pose that jumps, and numbers at the ends of their types in requests."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.world import MoveRobot
from rackhand.testing import distance, turn
from tests.joined.chassis import JoinedChassis
from tests.joined.world import JoinedWorld
from tests.system.driving import standard


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[JoinedChassis]:
    """A chassis at rest at its start in an empty hall."""
    with JoinedWorld("empty", tmp_path, seed=1, with_arms=False) as world:
        world.advance(0.4)
        yield world.chassis()


@pytest.mark.parametrize(("along", "turned"), [(0.0, 0.1), (0.1, 0.0), (0.3, -0.3)])
def test_moves_go_on_while_the_pose_jumps_each_second(along: float, turned: float, driver: JoinedChassis) -> None:
    world, goal, move = driver.world, 3.0, None
    for k in range(20):
        if move is None or driver.move(move).state == "succeeded":
            goal = -goal
            move = driver.post(standard(goal, 0.0))
        world.advance(1.0)
        pose, sign = world.true_pose("amr1"), (1, -1)[k % 2]
        there = Pose2(x=pose.x, y=pose.y + sign * along, yaw=math.remainder(pose.yaw + sign * turned, math.tau))
        world.ask(MoveRobot(robot="amr1", pose=there))
        assert driver.move(move).state != "failed", driver.move(move)
    assert driver.drive(standard(0.0, 2.0, 1.0), within=60.0).state == "succeeded"
    assert distance(world.true_pose("amr1"), 0.0, 2.0) < 0.05


@pytest.mark.parametrize("far", [1e6, 1e300, 1.7e308])
def test_a_goal_beyond_all_maps_is_outside_the_map(far: float, driver: JoinedChassis) -> None:
    for x, y in ((far, 0.0), (0.0, -far)):
        move = driver.drive(standard(x, y), within=5.0)
        assert (move.state, move.fail_reason) == ("failed", Reason.ENDING_POINT_OUT_OF_MAP), move


@pytest.mark.parametrize("yaw", [1e17, -1e17, 1e308, 100.0])
def test_any_number_is_some_heading(yaw: float, driver: JoinedChassis) -> None:
    move = driver.drive(standard(1.0, 0.0, yaw), within=30.0)
    assert move.state == "succeeded", move
    wanted = math.pi - (math.pi - yaw) % math.tau
    assert math.degrees(turn(driver.world.true_pose("amr1").yaw, wanted)) < 2.0
    assert driver.move(move.id).target_ori == yaw, "stored as sent"


def test_near_enough_is_there(driver: JoinedChassis) -> None:
    assert driver.drive(standard(2.0, 0.0, target_accuracy=5.0), within=1.0).state == "succeeded"
