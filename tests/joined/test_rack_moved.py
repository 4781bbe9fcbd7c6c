"""A rack that slides on the jack in physics: noticed from the scan, told, and driven with as it is now."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import ChassisStatus
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.world import Place, Push, Remove
from rackhand.services.planner.load import Slip
from tests.joined.chassis import JoinedChassis
from tests.joined.racks import hall_with_racks, lift, lower, rack_error, unload
from tests.joined.world import JoinedWorld


@pytest.fixture
def carrying(tmp_path: Path) -> Iterator[JoinedChassis]:
    with JoinedWorld(hall_with_racks(rack=("standard", 0.0, 0.0, 0.0)), tmp_path, seed=3, with_arms=False) as world:
        lift(world.chassis(), "rack", (0.01, 0.0, 0.02))
        yield world.chassis()


def push(driver: JoinedChassis, x: float, y: float, degrees: float = 0.0) -> None:
    driver.world.ask(Push(name="rack", shift=Pose2(x=x, y=y, yaw=math.radians(degrees))))


def alerts(driver: JoinedChassis) -> dict[int, str]:
    status: ChassisStatus = driver.newest(topics.CHASSIS_STATUS)
    return {alert.code: alert.level for alert in status.alerts}


@pytest.mark.parametrize(("x", "y", "degrees"), [(0.0, 0.09, 0.0), (0.0, 0.0, 6.0)], ids=("moved", "turned"))
def test_a_rack_that_slides_far_while_driving_fails_the_move_within_a_second(
    carrying: JoinedChassis, x: float, y: float, degrees: float
) -> None:
    move = carrying.post(unload(4.0, 0.0, 0.0))
    carrying.wait_until_moving()
    assert alerts(carrying) == {}
    push(carrying, x, y, degrees)
    pushed = carrying.world.now()
    ended = carrying.finish(move)
    assert carrying.world.now() - pushed <= 1.0
    assert (ended.state, ended.fail_reason) == ("failed", Reason.RACK_MOVED), ended
    assert " m and " in ended.fail_message and "degrees" in ended.fail_message
    assert alerts(carrying) == {12005: "error"}
    assert carrying.drive(unload(3.0, 1.0, 0.0)).state == "succeeded", "the next job works, with the rack as it is"
    metres, turned = rack_error(carrying, "rack", 3.0, 1.0, 0.0)
    assert metres < 0.03 and turned < 1.0
    lower(carrying)
    assert alerts(carrying) == {}


def test_a_rack_that_slides_a_little_is_a_warning_and_ends_where_it_should_all_the_same(
    carrying: JoinedChassis,
) -> None:
    move = carrying.post(unload(4.0, 0.0, 0.0))
    carrying.wait_until_moving()
    push(carrying, 0.0, 0.045)
    carrying.world.advance(1.0)
    assert alerts(carrying) == {9015: "warning"}
    assert carrying.core._motion.load.slipped is Slip.SLIGHTLY
    assert carrying.finish(move).state == "succeeded"
    metres, turned = rack_error(carrying, "rack", 4.0, 0.0, 0.0)
    assert metres < 0.03 and turned < 1.0


def test_driving_hard_does_not_move_the_rack(carrying: JoinedChassis) -> None:
    for x, y in ((4.0, 3.0), (-3.0, 3.0)):
        assert carrying.drive(unload(x, y, 0.0)).state == "succeeded"
    assert carrying.core._motion.load.slipped is Slip.NONE


def test_what_is_under_the_rack_holds_the_move_only_where_the_setting_says_so(carrying: JoinedChassis) -> None:
    motion = carrying.core._motion
    carrying.world.ask(Place(name="bin", pose=Pose2(x=0.0, y=0.31, yaw=0.0), size=(0.1, 0.05, 0.25)))
    motion.set_racks(motion.settings.rack_specs, ignore_objects_under_rack=False)
    start = carrying.world.true_pose(carrying.name)
    move = carrying.post(unload(3.0, 0.0, 0.0))
    carrying.world.advance(3.0)
    assert carrying.move(move).state == "moving"
    assert "under the rack, about (0.0" in carrying.planning_state.message
    assert carrying.world.true_pose(carrying.name).x == pytest.approx(start.x, abs=0.005)
    carrying.world.ask(Remove(name="bin"))
    assert carrying.finish(move).state == "succeeded"
