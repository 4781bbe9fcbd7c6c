"""Following a target in physics, in every stage what interrupts it ends or resumes it."""

from __future__ import annotations

import math

import pytest

from rackhand.schemas.chassis import FollowTarget, SetControlMode, SetEmergencyStop
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import PauseMove
from rackhand.schemas.refusal import RequestRefused
from rackhand.services.planner.settings import NavigationSettings
from tests.joined.chassis import JoinedChassis
from tests.system.driving import standard

ROBOT = "amr1"
WANTED = NavigationSettings().follow_distance
PERIOD = 0.32  # s between reports
STAGES = ["waiting for a report", "driving", "at the distance", "paused by the client"]
TARGET = (5.5, 1.5)


def report(driver: JoinedChassis, seconds: float, x: float, y: float) -> None:
    """Report a target at a point for so long."""
    for _ in range(round(seconds / PERIOD)):
        driver.ask(FollowTarget(state="follow_pose", position=(x, y)))
        driver.world.advance(PERIOD)


def begin(driver: JoinedChassis, stage: str) -> int:
    """A follow_target move in that stage, of a target 3 m ahead."""
    move = driver.post(type="follow_target")
    driver.world.advance(0.4)
    if stage == "driving":
        report(driver, 2.0, *TARGET)
        assert driver.odometry[-1].twist.linear > 0.2
    elif stage == "at the distance":
        report(driver, 9.0, *TARGET)
        assert abs(away(driver) - WANTED) < 0.2
    elif stage == "paused by the client":
        report(driver, 2.0, *TARGET)
        driver.ask(FollowTarget(state="pause"))
        driver.world.advance(12.0)
    assert driver.planning_state.move_state == "moving"
    return move


def away(driver: JoinedChassis) -> float:
    pose = driver.world.true_pose(ROBOT)
    return math.dist((pose.x, pose.y), TARGET)


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("end", ["cancel", "replace", "remote"])
def test_what_ends_following(driver: JoinedChassis, stage: str, end: str) -> None:
    move = begin(driver, stage)
    if end == "cancel":
        driver.cancel()
    elif end == "remote":
        driver.ask(SetControlMode(control_mode="remote"))
    else:
        assert driver.drive(standard(3.5, 1.5)).state == "succeeded"
    assert driver.move(move).state == "cancelled"
    driver.world.advance(1.0)
    assert driver.stays_still()
    with pytest.raises(RequestRefused, match="no follow_target move is running"):
        driver.ask(FollowTarget(state="follow_pose", position=TARGET))
    assert driver.world.inspect().contact_count == 0


def test_a_planner_that_is_killed_while_it_follows_comes_back_standing(driver: JoinedChassis) -> None:
    move = begin(driver, "driving")
    driver.restart()
    with pytest.raises(RequestRefused, match="no follow_target move is running"):
        driver.ask(FollowTarget(state="follow_pose", position=TARGET))
    driver.world.advance(1.0)
    assert driver.stays_still() and driver.planning_state.move_state == "failed"
    assert driver.move(move).fail_reason == MoveFailReason.PLATFORM_ALERT_ERROR
    begin(driver, "at the distance")
    assert driver.world.inspect().contact_count == 0


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("hold", ["stop", "pause", "velocity"])
def test_what_holds_following(driver: JoinedChassis, stage: str, hold: str) -> None:
    """Longer than silence may last: while it is held, nobody has to report."""

    def held(on: bool) -> None:
        if hold == "stop":
            driver.ask(SetEmergencyStop(enable=on))
        elif hold == "velocity":  # as integrators hold a robot without cancelling its move
            driver.set_parameters(max_forward_velocity=0.0 if on else 1.2)
        else:
            driver.change(PauseMove(paused=on))

    move = begin(driver, stage)
    held(True)
    driver.world.advance(1.5)
    assert driver.stays_still()
    driver.world.advance(10.0)
    held(False)
    report(driver, 9.0, *TARGET)
    assert driver.move(move).state == "moving" and abs(away(driver) - WANTED) < 0.2
    assert driver.world.inspect().contact_count == 0


def test_lost_regained_and_failed(driver: JoinedChassis) -> None:
    move = begin(driver, "driving")
    driver.world.advance(3.0)
    assert driver.stays_still(), "without reports it stops"
    report(driver, 9.0, *TARGET)
    assert abs(away(driver) - WANTED) < 0.2
    driver.ask(FollowTarget(state="fail"))
    driver.world.advance(0.1)
    assert (driver.move(move).state, driver.move(move).fail_reason) == ("failed", MoveFailReason.FOLLOW_FAILED)
    failed = driver.finish(driver.post(type="follow_target"), within=14.0)
    assert failed.fail_reason == MoveFailReason.FOLLOW_FAILED and "no /follow_target_state for" in failed.fail_message


def test_a_report_from_before_does_not_fail_the_next_move(driver: JoinedChassis) -> None:
    move = begin(driver, "driving")
    driver.ask(FollowTarget(state="fail"))
    following = driver.post(type="follow_target")
    driver.world.advance(0.4)
    assert (driver.move(move).state, driver.move(following).state) == ("cancelled", "moving")
