"""Driving out from under a rack before the next move: which way, when not, and what if it cannot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import JackRequest, SetEmergencyStop
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.world import Place, Remove
from rackhand.services.planner.load import LoadState
from tests.joined.chassis import JoinedChassis
from tests.joined.racks import hall_with_racks, lift, lower, put_under, rack_point
from tests.joined.world import JoinedWorld
from tests.system.driving import standard

HEADING = 0.5  # rad of the rack
GOAL = standard(-2.0, 1.5, 1.0)


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[JoinedChassis]:
    """A chassis under a rack in the middle of a hall."""
    world = hall_with_racks(rack=("standard", 0.0, 0.0, HEADING), other=("large", 3.0, -3.0, 0.0))
    with JoinedWorld(world, tmp_path, seed=2, with_arms=False) as joined:
        driver = joined.chassis()
        driver.overlay(rack_point("a", 0.0, 0.0, math.degrees(HEADING)), rack_point("b", 3.0, -3.0, 0.0))
        put_under(driver, "rack", (0.01, 0.005, 0.005))
        yield driver


def ahead(driver: JoinedChassis) -> float:
    """Metres by which the chassis is ahead of the rack's place."""
    pose = driver.world.true_pose(driver.name)
    return pose.x * math.cos(HEADING) + pose.y * math.sin(HEADING)


def block(driver: JoinedChassis, name: str, along: float) -> None:
    """A board across the axis of the rack."""
    x, y = along * math.cos(HEADING), along * math.sin(HEADING)
    driver.world.ask(Place(name=name, pose=Pose2(x=x, y=y, yaw=HEADING), size=(0.1, 1.2, 0.6)))


def drove_out(driver: JoinedChassis, move: int) -> float:
    """Where on the axis the chassis came out."""
    driver.world.wait_for(
        lambda: True if driver.core._motion.load.state is LoadState.FREE else None, f"move {move} drives out", 90.0
    )
    return ahead(driver)


def test_the_next_move_first_drives_back_out(driver: JoinedChassis) -> None:
    move = driver.post(GOAL)
    driver.world.advance(1.0)
    state = driver.planning_state
    assert state.flags == ("undocking_charger_or_rack",) and state.move_intent == "undocking_charger_or_rack"
    assert drove_out(driver, move) < -0.8
    assert driver.finish(move).state == "succeeded"
    assert "undocking_charger_or_rack" not in driver.planning_state.flags
    assert driver.world.inspect().contact_count == 0


def test_a_blocked_way_back_leads_out_ahead(driver: JoinedChassis) -> None:
    block(driver, "board", -1.0)
    move = driver.post(GOAL)
    assert drove_out(driver, move) > 0.8
    assert driver.finish(move).state == "succeeded"
    assert driver.world.inspect().contact_count == 0


def test_with_both_ways_blocked_it_waits_and_goes_when_one_is_free(driver: JoinedChassis) -> None:
    block(driver, "behind", -1.0)
    block(driver, "ahead", 1.0)
    move = driver.post(GOAL)
    driver.world.advance(15.0)
    states = [message for topic, message in driver.published if topic is topics.PLANNING_STATE]
    assert abs(ahead(driver)) < 0.55 and any(state.stuck_state == "move_stucked" for state in states)
    driver.world.ask(Remove(name="behind"))
    assert driver.finish(move).state == "succeeded"
    assert driver.world.inspect().contact_count == 0


def test_with_both_ways_blocked_for_long_it_fails(driver: JoinedChassis) -> None:
    block(driver, "behind", -1.0)
    block(driver, "ahead", 1.0)
    move = driver.drive(GOAL)
    assert (move.state, move.fail_reason) == ("failed", Reason.MOVE_TIMEOUT)
    assert "cannot drive out from under the rack" in move.fail_message and "free behind and ahead" in move.fail_message
    driver.world.ask(Remove(name="behind"))
    assert driver.drive(GOAL).state == "succeeded"


def test_it_is_undocked_after_a_rack_was_put_down(driver: JoinedChassis) -> None:
    driver.ask(JackRequest(direction="up"))
    driver.world.advance(14.0)
    assert driver.core._motion.load.state is LoadState.CARRYING
    lower(driver)
    move = driver.post(GOAL)
    assert drove_out(driver, move) < -0.8
    assert driver.finish(move).state == "succeeded"
    assert driver.world.inspect().contact_count == 0


def test_another_rack_is_aligned_with_after_driving_out_and_the_same_at_once(driver: JoinedChassis) -> None:
    begun = driver.world.now()
    same = {"type": "align_with_rack", "target_x": 0.0, "target_y": 0.0}
    assert driver.drive(same).state == "succeeded" and driver.world.now() - begun < 4.0
    assert abs(ahead(driver)) < 0.02
    assert driver.drive(same | {"target_x": 3.0, "target_y": -3.0}).state == "succeeded"
    pose = driver.world.true_pose(driver.name)
    assert (pose.x, pose.y) == pytest.approx((3.0, -3.0), abs=0.015)
    move = driver.post(standard(0.0, -3.0, 0.0))
    driver.world.wait_for(
        lambda: True if driver.core._motion.load.state is LoadState.FREE else None, "it is out from under it", 30.0
    )
    assert driver.world.true_pose(driver.name).x < 3.0 - 0.95
    driver.cancel(move)
    assert driver.world.inspect().contact_count == 0


def test_it_is_held_and_goes_on(driver: JoinedChassis) -> None:
    move = driver.post(GOAL)
    driver.world.advance(3.0)
    driver.ask(SetEmergencyStop(enable=True))
    driver.world.advance(2.0)
    before = ahead(driver)
    driver.world.advance(1.0)
    assert ahead(driver) == pytest.approx(before, abs=1e-3)
    driver.ask(SetEmergencyStop(enable=False))
    assert driver.finish(move).state == "succeeded"


def test_a_planner_that_was_restarted_still_drives_out(driver: JoinedChassis) -> None:
    driver.world.advance(0.2)
    driver.restart()
    assert driver.core._motion.load.state is LoadState.UNDER_RACK
    move = driver.post(GOAL)
    assert drove_out(driver, move) < -0.8
    assert driver.finish(move).state == "succeeded"
    assert driver.world.inspect().contact_count == 0


def test_with_the_rack_lifted_nothing_is_undocked(tmp_path: Path) -> None:
    with JoinedWorld(hall_with_racks(rack=("standard", 0.0, 0.0, 0.0)), tmp_path, seed=2, with_arms=False) as world:
        driver = world.chassis()
        lift(driver, "rack")
        driver.post(standard(2.0, 0.0, 0.0))
        world.advance(1.0)
        assert driver.planning_state.flags == ()
        driver.wait_until_moving()
        assert world.true_pose(driver.name).x > 0.25 and driver.core._motion.load.state is LoadState.CARRYING
