"""A lift in physics: a round trip, each fail reason by its cause, doors that close, and what ends or holds a move
before the lift, in its doorway and in its cabin.

One cell for all: each test begins with a chassis before the lift, whose doors are open at its floor unless it says
otherwise.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from PIL import Image

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import SetControlMode, SetEmergencyStop
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.lift import CallLift, HoldDoor
from rackhand.schemas.maps import GetMap
from rackhand.schemas.planar import as_tuple
from rackhand.schemas.world import InjectFault, MoveRobot, Place, Remove
from rackhand.testing import distance
from rackhand.worlds.world_model import load_world
from tests.joined.lifts import CLIENT, LiftUser
from tests.joined.world import JoinedWorld

ROBOT, DOWN, UP = "amr1", "floor1", "floor2"
DOOR_Y = 2.4  # of the shaft's door downstairs


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[JoinedWorld]:
    alone = load_world("warehouse").model_copy(update={"movers": {}})
    with JoinedWorld(alone, tmp_path_factory.mktemp("lifts"), with_arms=False) as world:
        yield world


@pytest.fixture
def user(cell: JoinedWorld) -> Iterator[LiftUser]:
    """As after ``begin``. Nothing touches a door or anything else in any test."""
    user, before = LiftUser(cell.chassis()), cell.inspect().contact_count
    user.driver.use_stored_map()
    begin(user)
    yield user
    user.driver.ask(SetControlMode(control_mode="auto"))
    user.driver.ask(SetEmergencyStop(enable=False))
    assert cell.inspect().contact_count == before, cell.inspect().contacts


def begin(user: LiftUser) -> None:
    """The chassis waits before the lift, which is open at its floor and stays so for 10 s."""
    user.world.ask(MoveRobot(robot=ROBOT, pose=user.waiting(DOWN)))
    user.call(DOWN)
    user.ask(HoldDoor(client=CLIENT))
    user.world.advance(0.6)


@contextmanager
def fault(user: LiftUser, name: str, target: str = "lift_1") -> Iterator[None]:
    """That fault, for so long."""
    user.world.ask(InjectFault(target=target, fault=name))
    try:
        yield
    finally:
        user.world.ask(InjectFault(target=target, fault=name, active=False))


def away(user: LiftUser, x: float, y: float, _yaw: float = 0.0) -> float:
    """Metres from the true place of the chassis."""
    return distance(user.world.true_pose(ROBOT), x, y)


def goes_back(user: LiftUser) -> None:
    """After a failed move: to where the chassis waited, without a contact."""
    move = user.finish(user.leave(DOWN, "return_to_elevator_waiting_point"))
    assert move.state == "succeeded", move.fail_message
    assert away(user, *as_tuple(user.waiting(DOWN))) < 0.05


def flags(user: LiftUser) -> set[str]:
    return set(user.driver.planning_state.flags)


# -- a ride ------------------------------------------------------------------------------------------------------------


def test_a_round_trip(user: LiftUser) -> None:
    """In, up, out after the change of the map, and the same back; the state says where the chassis is."""
    seen: list[tuple[str, bool]] = []
    for here, there in ((DOWN, UP), (UP, DOWN)):
        user.call(here)
        entered = user.finish(user.enter(here))
        assert entered.state == "succeeded", entered.fail_message
        assert away(user, *user.cabin(here)) < 0.05
        seen.append((user.driver.planning_state.action_type, "in_elevator" in flags(user)))
        user.ride(there)
        user.world.advance(0.2)
        assert user.driver.planning_state.map_uid != "" and "in_elevator" in flags(user)
        left = user.finish(user.leave(there))
        assert left.state == "succeeded", left.fail_message
        assert away(user, *as_tuple(user.waiting(there))) < 0.05
        seen.append((user.driver.planning_state.action_type, "in_elevator" in flags(user)))
        user.release()
    assert seen == [("enter_elevator", True), ("standard", False)] * 2


# -- 300 to 304 --------------------------------------------------------------------------------------------------------


def test_300_a_person_in_the_cabin_and_again_when_it_has_left(user: LiftUser) -> None:
    with fault(user, "lift_occupied"):
        begun, move = user.world.now(), user.enter(DOWN)
        user.world.advance(1.0)
        assert "is_waiting_for_dest" in flags(user) and user.driver.stays_still()
        failed = user.finish(move)
        assert (failed.state, failed.fail_reason) == ("failed", Reason.ELEVATOR_POINT_OCCUPIED), failed.fail_message
        assert 13.0 < user.world.now() - begun < 20.0, "3 s of stopping, then as far as there is room, then 10 s"
        assert "is_waiting_for_dest" not in flags(user)
        goes_back(user)
    again = user.enter(DOWN)
    assert user.finish(again).state == "succeeded", user.driver.move(again).fail_message


def test_301_a_lift_that_someone_else_has_taken(user: LiftUser) -> None:
    """Its door closes, the call waits for others; when they are done it comes."""
    with fault(user, "lift_taken"):
        user.wait_for(door="closed")
        begun, move = user.world.now(), user.enter(DOWN)
        assert user.ask(CallLift(client=CLIENT, floor=DOWN)).waiting == (CLIENT,)
        user.world.advance(1.0)
        assert "is_waiting_for_dest" in flags(user) and "door is closed" in user.driver.planning_state.message
        failed = user.finish(move)
        assert failed.fail_reason == Reason.ELEVATOR_CLOSED and user.world.now() - begun < 4.5, failed.fail_message
    user.call(DOWN)
    move = user.enter(DOWN)
    assert user.finish(move).state == "succeeded", user.driver.move(move).fail_message


def test_302_something_that_hides_the_cabin(user: LiftUser) -> None:
    hide(user, 2.9)  # no path is left
    begun, move = user.world.now(), user.enter(DOWN)
    failed = user.finish(move)
    user.world.ask(Remove(name="crate"))
    assert failed.fail_reason == Reason.ELEVATOR_POINT_OBSCURED_TIMEOUT, failed.fail_message
    assert 20.0 < user.world.now() - begun < 22.0
    assert away(user, *as_tuple(user.waiting(DOWN))) < 0.15, "it stopped where it waited"


def hide(user: LiftUser, y: float) -> None:
    """The place in the cabin, behind a crate."""
    user.world.ask(Place(name="crate", pose=Pose2(x=18.6, y=y, yaw=0.0), size=(0.9, 0.2, 0.6)))


def test_303_a_mapped_screen_before_the_place(user: LiftUser) -> None:
    """What is behind a wall of the map is unknown, and nothing new hides it."""
    data = user.driver.ask_maps(GetMap()).data
    assert data is not None
    grey = np.asarray(Image.open(io.BytesIO(data.png)).convert("L"))[::-1].copy()
    x, y, size = *data.origin, data.resolution
    grey[int((1.70 - y) / size) : int((1.82 - y) / size), int((18.2 - x) / size) : int((19.0 - x) / size)] = 0
    drawn = io.BytesIO()
    Image.fromarray(grey[::-1]).save(drawn, "PNG")
    user.driver.use_map(drawn.getvalue(), x, y, size, *data.overlays["features"])
    user.world.ask(Place(name="screen", pose=Pose2(x=18.6, y=1.76, yaw=0.0), size=(0.8, 0.1, 1.5)))
    begun, move = user.world.now(), user.enter(DOWN, target_y=0.6)
    failed = user.finish(move)
    user.world.ask(Remove(name="screen"))
    assert failed.fail_reason == Reason.ELEVATOR_POINT_OCCUPANCY_DETECTION_TIMEOUT, failed.fail_message
    assert 10.0 < user.world.now() - begun < 12.0


def test_304_wheels_that_do_not_turn(user: LiftUser) -> None:
    with fault(user, "wheels_blocked", ROBOT):
        begun, move = user.world.now(), user.enter(DOWN)
        user.world.advance(4.0)
        assert user.driver.planning_state.stuck_state == "move_stucked"
        failed = user.finish(move)
    assert failed.fail_reason == Reason.ELEVATOR_ENTER_PROGRESS_UPDATE_TIMEOUT, failed.fail_message
    assert 10.0 < user.world.now() - begun < 12.0


# -- doors that close --------------------------------------------------------------------------------------------------


def test_a_door_that_closes_before_it_stops_the_chassis(user: LiftUser) -> None:
    """Even one that nothing between its leaves would stop."""
    move = user.enter(DOWN)
    user.world.advance(0.8)
    with fault(user, "lift_door_closes"):
        failed = user.finish(move)
        assert failed.fail_reason == Reason.ELEVATOR_CLOSED, failed.fail_message
        assert user.world.true_pose(ROBOT).y - 0.375 > DOOR_Y + 0.1
        goes_back(user)


def test_a_door_that_closes_behind_the_nose_lets_the_chassis_in(user: LiftUser) -> None:
    move = user.enter(DOWN)
    user.world.wait_for(lambda: True if user.world.true_pose(ROBOT).y < 2.5 else None, "in the doorway", 10.0, 0.04)
    with fault(user, "lift_door_closes"):
        assert user.finish(move).state == "succeeded", user.driver.move(move).fail_message
        assert user.state.door == "closed" and "in_elevator" in flags(user)


# -- what interrupts it ------------------------------------------------------------------------------------------------


def waits(user: LiftUser) -> int:
    """A move that waits before something that hid the place until now."""
    hide(user, DOOR_Y + 0.15)
    move = user.enter(DOWN)
    user.world.advance(1.2)
    assert "is_waiting_for_dest" in flags(user)
    user.world.ask(Remove(name="crate"))
    return move


def enters(user: LiftUser) -> int:
    move = user.enter(DOWN)
    user.world.wait_for(lambda: True if user.world.true_pose(ROBOT).y < 2.5 else None, "in the doorway", 10.0, 0.04)
    return move


def turns(user: LiftUser) -> int:
    """In the cabin, turning to the door."""
    x, y, yaw = user.cabin(DOWN)
    user.world.ask(MoveRobot(robot=ROBOT, pose=Pose2(x=x, y=y, yaw=-yaw)))
    user.world.advance(0.6)
    move = user.enter(DOWN)
    user.world.advance(1.0)
    assert "in_elevator" in flags(user) and user.driver.odometry[-1].twist.angular != 0.0
    return move


@pytest.mark.parametrize("stage", [waits, enters, turns])
def test_what_ends_and_what_holds_it(user: LiftUser, stage: Callable[[LiftUser], int]) -> None:
    driver = user.driver
    for end in (cancel, replace, remote, restart):
        begin(user)
        move = stage(user)
        where = "in_elevator" in flags(user)
        expected = end(user)
        user.world.advance(1.0)
        ended = driver.move(move)
        assert (ended.state, ended.fail_reason) == expected, end
        assert driver.stays_still() and "is_waiting_for_dest" not in flags(user), end
        assert end is replace or ("in_elevator" in flags(user)) is where, end
        driver.ask(SetControlMode(control_mode="auto"))
    begin(user)
    move = stage(user)
    driver.ask(SetEmergencyStop(enable=True))
    user.world.advance(1.0)
    assert driver.stays_still() and driver.move(move).state == "moving"
    driver.ask(SetEmergencyStop(enable=False))
    assert user.finish(move).state == "succeeded", driver.move(move).fail_message
    assert away(user, *user.cabin(DOWN)) < 0.05


End = tuple[str, int]


def cancel(user: LiftUser) -> End:
    user.driver.cancel()
    return "cancelled", 0


def replace(user: LiftUser) -> End:
    assert user.finish(user.leave(DOWN, "return_to_elevator_waiting_point")).state == "succeeded"
    return "cancelled", 0


def remote(user: LiftUser) -> End:
    user.driver.ask(SetControlMode(control_mode="remote"))
    return "cancelled", 0


def restart(user: LiftUser) -> End:
    user.driver.restart()
    return "failed", Reason.PLATFORM_ALERT_ERROR


def test_a_chassis_that_is_stopped_between_the_doors_is_not_touched(user: LiftUser) -> None:
    """For longer than the lift waits, while nobody holds the door."""
    move = enters(user)
    user.driver.ask(SetEmergencyStop(enable=True))
    user.world.advance(12.0)
    assert user.state.blocked and user.state.door == "open"
    assert user.driver.planning_state.move_state == "moving" and "in_elevator" not in flags(user)
    user.driver.ask(SetEmergencyStop(enable=False))
    assert user.finish(move).state == "succeeded", user.driver.move(move).fail_message


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"target_x": None, "target_y": None}, Reason.ENDING_POINT_NOT_SPECIFIED),
        ({"target_x": 14.0, "target_y": 3.0}, Reason.CONFIGURATION_ERROR),
        ({"target_x": 17.3}, Reason.ENDING_POINT_NOT_IN_GROUND),
    ],
)
def test_targets_that_are_no_place_in_a_lift(user: LiftUser, fields: dict[str, float], reason: Reason) -> None:
    failed = user.finish(user.enter(DOWN, **fields))
    assert (failed.fail_reason, failed.state) == (reason, "failed"), failed.fail_message
    assert user.driver.stays_still()
