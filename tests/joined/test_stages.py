"""In every stage of a rack job and of charging: an emergency stop, cancel, remote mode, another move, and the planner
killed. Nothing is touched, the state stays true, and a client that reads only the API ends the job."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import pytest

from benchmarks.align import charger_point, hall_with_charger
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import JackRequest, SetEmergencyStop
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.world import InjectFault, MoveObject, MoveRobot
from rackhand.services.planner.load import LoadState
from rackhand.testing.poses import distance
from tests.joined import interrupts
from tests.joined.chassis import JoinedChassis
from tests.joined.interrupts import interrupt
from tests.joined.racks import STROKE, hall_with_racks, put_under, rack_error, rack_point, unload
from tests.joined.world import JoinedWorld
from tests.system.driving import standard

DOCK = (-3.0, 0.0)
RACK_POINT, CHARGER_POINT = rack_point("a", 1.0, 0.0, 0.0), charger_point("c", *DOCK, 0.0)
ALIGN = {"type": "align_with_rack", "target_x": 1.0, "target_y": 0.0}
CHARGE = {"type": "charge"}


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Iterator[JoinedWorld]:
    """A rack and a charger on one line, 4 m apart."""
    world = hall_with_racks(rack=("standard", 1.0, 0.0, 0.0)).model_copy(
        update={"chargers": hall_with_charger().chargers, "movers": {}}
    )
    with JoinedWorld(world, tmp_path_factory.mktemp("hall"), seed=3, with_arms=False) as joined:
        yield joined


def start(hall: JoinedWorld, *overlays: dict[str, object], x: float = -0.7, y: float = 0.1) -> JoinedChassis:
    driver = hall.chassis()
    driver.overlay(*overlays)
    hall.ask(MoveObject(name="rack", pose=Pose2(x=1.0, y=0.0, yaw=0.0)))
    hall.ask(MoveRobot(robot=driver.name, pose=Pose2(x=x, y=y, yaw=0.1)))
    hall.advance(0.5)
    return driver


def until(driver: JoinedChassis, what: str, within: float, of: float) -> None:
    """Until the chassis is so near to x = ``of`` (m)."""
    hall = driver.world
    hall.wait_for(lambda: abs(hall.true_pose(driver.name).x - of) < within or None, what, 60.0, step=0.1)


def load_of(driver: JoinedChassis) -> LoadState:
    return driver.core._motion.load.state


def leave(driver: JoinedChassis, x: float, *overlays: dict[str, object]) -> None:
    """Out of the dock, interrupted on the way, and on to a place beside it."""
    body = standard(x, 1.5, 0.0)
    move = driver.post(body)
    driver.world.advance(0.6)
    assert driver.planning_state.flags == ("undocking_charger_or_rack",)
    assert driver.finish(interrupt(driver, move, body, *overlays)).state == "succeeded"
    assert load_of(driver) is LoadState.FREE


def jack(driver: JoinedChassis, direction: Literal["up", "down"], seconds: float = STROKE) -> float:
    """Progress after so much of a stroke."""
    driver.ask(JackRequest(direction=direction))
    driver.world.advance(seconds)
    return progress(driver)


def progress(driver: JoinedChassis) -> float:
    state = driver.core._state.jack
    assert state is not None
    return state.progress


def kill_in_the_stroke(driver: JoinedChassis, *overlays: dict[str, object]) -> None:
    """The jack stops where it is, the load is what it was, and nothing drives before it has arrived."""
    load, before = load_of(driver), progress(driver)
    driver.restart()
    driver.world.advance(1.0)
    assert 0.1 < progress(driver) < 0.9 and abs(progress(driver) - before) < 0.05 and load_of(driver) is load
    driver.overlay(*overlays)
    pose = driver.world.true_pose(driver.name)
    move = driver.drive(standard(pose.x - 2.0, pose.y, 0.0))
    assert move.fail_reason == Reason.JACK_IN_UP_STATE and "call jack_" in move.fail_message, move
    assert distance(driver.world.true_pose(driver.name), pose.x, pose.y) < 0.002


def check_untouched(driver: JoinedChassis, x: float, y: float) -> None:
    """No contact but those of the work, and the rack where it is meant to be."""
    assert driver.world.inspect().contact_count == 0
    away, turned = rack_error(driver, "rack", x, y, 0.0)
    assert away < 0.03 and turned < 1.0


def test_align_and_undocking(hall: JoinedWorld) -> None:
    driver = start(hall, RACK_POINT)
    move = driver.post(ALIGN)
    for stage, within in (("to the staging pose", 1.5), ("crawling under", 0.7), ("centring", 0.06)):
        until(driver, stage, within, 1.0)
        move = interrupt(driver, move, ALIGN, RACK_POINT)
    assert driver.finish(move).state == "succeeded", driver.move(move)
    assert load_of(driver) is LoadState.UNDER_RACK
    leave(driver, -0.7, RACK_POINT)
    check_untouched(driver, 1.0, 0.0)
    assert rack_error(driver, "rack", 1.0, 0.0, 0.0)[0] < 0.002


def test_raising_carrying_and_lowering(hall: JoinedWorld) -> None:
    driver = start(hall, RACK_POINT)
    put_under(driver, "rack")
    assert 0.3 < jack(driver, "up", 6.0) < 0.7
    kill_in_the_stroke(driver, RACK_POINT)
    assert jack(driver, "up") == 1.0 and load_of(driver) is LoadState.CARRYING

    body = unload(3.0, 0.4, 0.0)
    move = driver.post(body)
    for stage, within in (("carrying", 1.5), ("at the place", 0.2)):
        until(driver, stage, within, 3.0)
        move = interrupt(driver, move, body, RACK_POINT)
        assert load_of(driver) is LoadState.CARRYING
    assert driver.finish(move).state == "succeeded", driver.move(move)

    assert 0.3 < jack(driver, "down", 6.0) < 0.7
    driver.ask(SetEmergencyStop(enable=True))
    driver.world.advance(0.2)
    before = progress(driver)
    driver.world.advance(1.0)
    assert progress(driver) == before, "the jack holds"
    driver.ask(SetEmergencyStop(enable=False))
    driver.world.advance(1.0)
    kill_in_the_stroke(driver, RACK_POINT)
    assert jack(driver, "down") == 0.0 and load_of(driver) is LoadState.UNDER_RACK
    leave(driver, 0.0, RACK_POINT)
    check_untouched(driver, 3.0, 0.4)


def test_charging_and_leaving_the_charger(hall: JoinedWorld) -> None:
    driver = start(hall, CHARGER_POINT, x=DOCK[0] + 1.7)
    hall.ask(InjectFault(target=driver.name, fault="no_charge_current", active=True))
    move = driver.post(CHARGE)
    for stage, within in (("to the staging pose", 1.4), ("onto the contacts", 0.45)):
        until(driver, stage, within, DOCK[0])
        move = interrupt(driver, move, CHARGE, CHARGER_POINT)
    hall.wait_for(lambda: "waiting_for_charge" in driver.planning_state.flags or None, "the contacts meet", 60.0)
    interrupts.stop(driver, move, lambda: move)
    hall.ask(InjectFault(target=driver.name, fault="no_charge_current", active=False))
    ended = driver.finish(move)
    assert (ended.state, ended.is_charging, load_of(driver)) == ("succeeded", True, LoadState.DOCKED), ended

    driver.restart()
    driver.overlay(CHARGER_POINT)
    before = hall.true_pose(driver.name)
    assert driver.drive(CHARGE).state == "succeeded", "what the battery does is not known yet"
    assert driver.drive(CHARGE).fail_reason == Reason.ALREADY_IN_CHARGING
    assert distance(hall.true_pose(driver.name), before.x, before.y) < 0.005 and load_of(driver) is LoadState.DOCKED
    leave(driver, DOCK[0] + 1.5, CHARGER_POINT)
    assert hall.inspect().contact_count == 0
