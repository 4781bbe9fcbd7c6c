"""align_with_rack in physics: how well the chassis is centred, and each reason to fail, raised by its cause."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rackhand.schemas import planar, topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import SetEmergencyStop
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import Move
from rackhand.schemas.racks import DetectedRack
from rackhand.schemas.world import InjectFault, MoveObject, MoveRobot, Place, Push, Remove
from rackhand.services.planner.load import LoadState
from rackhand.worlds.world_model import RackKind
from tests.joined.chassis import JoinedChassis
from tests.joined.racks import Cause, check_failure, hall_with_racks, put_under, rack_point, with_jack_up
from tests.joined.world import JoinedWorld

ALIGN = {"type": "align_with_rack", "target_x": 0.0, "target_y": 0.0}
DEGREE = math.radians(1.0)


def hall(
    tmp_path: Path, kind: str = "standard", seed: int = 1, rack: tuple[float, float, float] = (0, 0, 0)
) -> JoinedWorld:
    return JoinedWorld(hall_with_racks(rack=(kind, *rack)), tmp_path, seed=seed, with_arms=False)


def begin(world: JoinedWorld, x: float = -3.0, y: float = 0.0, yaw: float = 0.0) -> JoinedChassis:
    """The chassis there, and a rack point a in the middle of the hall that faces along x."""
    driver = world.chassis()
    driver.overlay(rack_point("a", 0.0, 0.0, 0.0))
    world.ask(MoveRobot(robot=driver.name, pose=Pose2(x=x, y=y, yaw=yaw)))
    world.advance(0.5)
    return driver


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[JoinedChassis]:
    with hall(tmp_path) as world:
        yield begin(world, -2.0)


def off_rack(driver: JoinedChassis) -> tuple[float, float, float]:
    """The chassis' true pose in the rack's frame."""
    rack, chassis = driver.world.true_pose("rack"), driver.world.true_pose(driver.name)
    return planar.between((rack.x, rack.y, rack.yaw), (chassis.x, chassis.y, chassis.yaw))


def is_under(driver: JoinedChassis) -> bool:
    x, y, yaw = off_rack(driver)
    centred = abs(x) < 0.02 and abs(y) < 0.01 and abs(yaw) < 0.01
    return centred and driver.core._motion.load.state is LoadState.UNDER_RACK


def wait_until(driver: JoinedChassis, ahead: float) -> None:
    """Until the chassis is so far from the rack's middle (negative before it)."""
    driver.world.wait_for(lambda: True if off_rack(driver)[0] > ahead else None, f"it is at {ahead} m", 60.0)


def no_contact(driver: JoinedChassis) -> bool:
    return driver.world.inspect().contact_count == 0


@pytest.mark.parametrize(
    ("kind", "seed", "rack", "start"),
    [
        ("standard", 1, (0.05, -0.03, 4 * DEGREE), (0.2, 0.1)),
        ("standard", 2, (-0.03, 0.05, -4 * DEGREE), (-0.3, -0.4)),
        ("large", 3, (0.05, 0.03, -4 * DEGREE), (0.3, 0.5)),
    ],
)
def test_the_chassis_is_centred_under_a_rack_that_is_off_its_point(
    tmp_path: Path, kind: str, seed: int, rack: tuple[float, float, float], start: tuple[float, float]
) -> None:
    """From 3 m before the point, within 15 s; the noise of the scan is 1 cm."""
    with hall(tmp_path, kind, seed, rack) as world:
        driver = begin(world, -3.0, *start)
        begun = world.now()
        move = driver.drive(ALIGN)
        assert move.state == "succeeded", move
        took, (x, y, yaw) = world.now() - begun, off_rack(driver)
        assert abs(y) <= 0.01 and abs(yaw) <= 0.005 and abs(x) <= 0.015
        assert took <= 15.0
        assert no_contact(driver)
        load, true = driver.core._motion.load, world.true_pose("rack")
        assert load.state is LoadState.UNDER_RACK and load.rack_pose is not None and load.spec is not None
        assert load.rack_pose == pytest.approx((true.x, true.y, true.yaw), abs=0.05)
        assert abs(load.spec.width - (0.83 if kind == "standard" else 0.9)) < 1e-9


def test_what_is_published_of_it(driver: JoinedChassis) -> None:
    driver.drive(ALIGN)
    found = [m for topic, m in driver.published if topic is topics.DETECTED_RACK]
    assert len(found) > 20 and all(isinstance(m, DetectedRack) for m in found)
    last = found[-1]
    assert last.detected and last.legs.shape == (4, 2) and last.staging is not None
    assert (last.pose.x, last.pose.y, last.pose.yaw) == pytest.approx((0.0, 0.0, 0.0), abs=0.04)
    assert (last.width, last.depth) == pytest.approx((0.83, 0.83), abs=0.02)
    moving = [m for topic, m in driver.published if topic is topics.PLANNING_STATE and m.move_state == "moving"]
    aligning = [m for m in moving if "aligning_with_rack" in m.flags]
    assert aligning and all(m.target is None and m.remaining_distance == 0.0 for m in moving)
    assert aligning[-1].intent_target.x == pytest.approx(0.0, abs=0.04)


def test_along_a_route_to_the_side_that_the_point_is_docked_from(driver: JoinedChassis) -> None:
    """Round the rack, which the way in from the front would not need."""
    point = rack_point("a", 0.0, 0.0, 0.0)
    point["properties"]["dockViaDirection"] = "back"
    driver.overlay(point)
    move = driver.post(ALIGN | {"route_coordinates": "-1.6, 0, -1.6, 1.6, 1.9, 1.6"})
    driver.world.wait_for(lambda: off_rack(driver)[0] > 0.0 or None, "it is beside the rack", 60.0)
    assert abs(off_rack(driver)[1] - 1.6) < 0.05
    assert driver.finish(move).state == "succeeded"
    x, y, yaw = off_rack(driver)
    assert abs(x) < 0.02 and abs(y) < 0.01 and abs(abs(yaw) - math.pi) < 0.01
    assert driver.planning_state.passed_points == 3 and no_contact(driver)


def test_under_the_rack_already_it_is_only_centred(driver: JoinedChassis) -> None:
    put_under(driver, "rack", (0.04, 0.006, 0.01))
    begun = driver.world.now()
    assert driver.drive(ALIGN).state == "succeeded"
    assert is_under(driver) and driver.world.now() - begun < 6.0
    begun = driver.world.now()
    assert driver.drive(ALIGN).state == "succeeded" and driver.world.now() - begun < 1.5


def test_another_heading_than_that_of_the_point(tmp_path: Path) -> None:
    with hall(tmp_path) as world:
        driver = begin(world, 0.0, -2.5, 1.0)
        assert driver.drive(ALIGN | {"target_ori": 1.5708, "properties": {"rack_layer": 0}}).state == "succeeded"
        assert off_rack(driver)[2] == pytest.approx(math.pi / 2, abs=0.01)


# -- reasons to fail ---------------------------------------------------------------------------------------------------


def no_rack_point_there(driver: JoinedChassis) -> Move:
    return driver.drive(ALIGN | {"target_x": 1.0})


def no_such_layer(driver: JoinedChassis) -> Move:
    return driver.drive(ALIGN | {"properties": {"rack_layer": 1}})


def no_rack_at_the_point(driver: JoinedChassis) -> Move:
    driver.world.ask(Remove(name="rack"))
    return driver.drive(ALIGN)


def a_hidden_leg(driver: JoinedChassis) -> Move:
    driver.world.ask(InjectFault(target="rack", fault="leg_hidden", part=2))
    return driver.drive(ALIGN)


def too_far_off_its_point(driver: JoinedChassis) -> Move:
    driver.world.ask(MoveObject(name="rack", pose=Pose2(x=0.1, y=0.25, yaw=0.1)))
    return driver.drive(ALIGN)


def taken_away_meanwhile(driver: JoinedChassis) -> Move:
    move = driver.post(ALIGN)
    wait_until(driver, -0.9)
    driver.world.ask(Remove(name="rack"))
    return driver.finish(move)


def something_under_the_rack(driver: JoinedChassis) -> Move:
    driver.world.ask(Place(name="crate", pose=Pose2(x=0.2, y=0.0, yaw=0.0), size=(0.15, 0.15, 0.25)))
    return driver.drive(ALIGN)


def jack_up(driver: JoinedChassis) -> Move:
    return with_jack_up(driver, ALIGN)


CAUSES: list[tuple[Reason, str, Cause]] = [
    (Reason.INVALID_RACK_DETECTION_POS, "the nearest is 'a' at (0.00, 0.00), 1.00 m away", no_rack_point_there),
    (Reason.INVALID_RACK_DETECTION_POS, "properties.rack_layer is 1", no_such_layer),
    (Reason.RACK_DETECTION_ERROR, "failed to find rack: no legs", no_rack_at_the_point),
    (Reason.RACK_DETECTION_ERROR, "failed to find rack: 3 of 4 legs", a_hidden_leg),
    (Reason.RACK_DETECTION_ERROR, "the rack is 0.2", too_far_off_its_point),
    (Reason.RACK_DETECTION_ERROR, "failed to find rack", taken_away_meanwhile),
    (Reason.RACK_RETRY_COUNT_EXCEEDED, "an obstacle under the rack, +0.1", something_under_the_rack),
    (Reason.JACK_IN_UP_STATE, "the jack is at 100%", jack_up),
]


@pytest.mark.parametrize(("reason", "text", "cause"), CAUSES, ids=[cause.__name__ for *_, cause in CAUSES])
def test_it_fails_for_its_cause(driver: JoinedChassis, reason: Reason, text: str, cause: Cause) -> None:
    check_failure(driver, cause, reason, text)


def test_a_rack_of_a_size_that_is_not_configured(tmp_path: Path) -> None:
    world = hall_with_racks(rack=("odd", 0.0, 0.0, 0.0))
    kinds = world.rack_kinds | {"odd": RackKind(size=(0.7, 0.75), underside=0.28, height=1.2, mass=60)}
    with JoinedWorld(world.model_copy(update={"rack_kinds": kinds}), tmp_path, seed=1, with_arms=False) as joined:
        move = begin(joined, -2.0).drive(ALIGN)
        assert move.fail_reason == Reason.RACK_DETECTION_ERROR
        assert move.fail_message.startswith("Wrong rack size: detected(0.7"), move.fail_message
        assert "configed(0.830,0.830)" in move.fail_message


# -- what happens meanwhile --------------------------------------------------------------------------------------------


def test_a_rack_that_is_pushed_meanwhile_is_followed(driver: JoinedChassis) -> None:
    move = driver.post(ALIGN)
    wait_until(driver, -1.3)
    driver.world.ask(Push(name="rack", shift=Pose2(x=0.02, y=0.06, yaw=0.03)))
    assert driver.finish(move).state == "succeeded"
    assert is_under(driver) and no_contact(driver)


@pytest.mark.parametrize("ahead", [-1.8, -1.0, -0.3], ids=["staging", "before", "under"])
def test_an_emergency_stop_holds_it_and_it_goes_on(driver: JoinedChassis, ahead: float) -> None:
    move = driver.post(ALIGN)
    wait_until(driver, ahead)
    driver.ask(SetEmergencyStop(enable=True))
    driver.world.advance(3.0)
    there = off_rack(driver)
    driver.world.advance(1.0)
    assert off_rack(driver) == pytest.approx(there, abs=1e-4) and driver.move(move).state == "moving"
    driver.ask(SetEmergencyStop(enable=False))
    assert driver.finish(move).state == "succeeded"
    assert is_under(driver) and no_contact(driver)


def test_a_chassis_that_was_set_down_elsewhere_while_it_was_held_begins_anew(driver: JoinedChassis) -> None:
    move = driver.post(ALIGN)
    wait_until(driver, -0.3)
    driver.ask(SetEmergencyStop(enable=True))
    driver.world.advance(1.0)
    driver.world.ask(MoveRobot(robot=driver.name, pose=Pose2(x=-2.0, y=0.8, yaw=0.5)))
    driver.world.advance(1.0)
    driver.ask(SetEmergencyStop(enable=False))
    assert driver.finish(move).state == "succeeded"
    assert is_under(driver) and no_contact(driver)


def test_cancelled_under_way_it_is_known_to_be_under_the_rack(driver: JoinedChassis) -> None:
    move = driver.post(ALIGN)
    wait_until(driver, -0.5)
    assert driver.cancel(move).state == "cancelled"
    driver.world.advance(1.0)
    assert driver.core._motion.load.state is LoadState.UNDER_RACK
    assert driver.drive(ALIGN).state == "succeeded" and is_under(driver)
    poses = np.array([(o.pose.x, o.pose.y) for o in driver.odometry[-50:]])
    assert np.ptp(poses, axis=0).max() < 0.6
