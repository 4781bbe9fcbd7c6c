"""Given routes in physics: the line is kept within centimetres of the truth, in every stage what interrupts it ends or
resumes it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import SetControlMode, SetEmergencyStop
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import PauseMove
from rackhand.schemas.world import Place
from tests.joined.chassis import JoinedChassis
from tests.planner.plant import off_line
from tests.system.driving import standard

ROBOT = "amr1"
ROUTE = np.array([(2.8, 1.5), (4.2, 1.5), (4.2, 2.2), (3.4, 2.2)])
TEXT = ", ".join(f"{x}, {y}" for x, y in ROUTE)
LOCALISED = 0.01  # m of the localised pose off the true one, 1 sigma; by the former the tolerance is kept
BODY = {"type": "along_given_route", "route_coordinates": TEXT, "target_ori": 1.57}


def wait_for(driver: JoinedChassis, stage: str) -> None:
    """Let time pass until the move is in this stage."""
    reached: dict[str, Callable[[], bool]] = {
        "joining": lambda: driver.planning_state.remaining_distance > 0.0,
        "on the line": lambda: driver.planning_state.passed_points == 1 and speed(driver) > 0.3,
        "at a corner": lambda: (
            driver.planning_state.passed_points == 2 and abs(driver.odometry[-1].twist.angular) > 0.3
        ),
        "turning at the end": lambda: (
            driver.planning_state.passed_points == 4
            and driver.planning_state.remaining_distance == 0.0
            and abs(driver.odometry[-1].twist.angular) > 0.2
        ),
    }
    driver.world.wait_for(lambda: reached[stage]() or None, f"stage {stage}", 90.0, step=0.08)


def speed(driver: JoinedChassis) -> float:
    return driver.odometry[-1].twist.linear


STAGES = ["joining", "on the line", "at a corner", "turning at the end"]


def cancel(driver: JoinedChassis) -> str:
    driver.cancel()
    return "cancelled"


def replace(driver: JoinedChassis) -> str:
    driver.post(standard(4.0, 1.5))
    return "cancelled"


def remote(driver: JoinedChassis) -> str:
    driver.ask(SetControlMode(control_mode="remote"))
    return "cancelled"


@pytest.mark.parametrize("stage", STAGES)
def test_what_ends_a_route(driver: JoinedChassis, stage: str) -> None:
    for end in (cancel, replace, remote):
        move = driver.post(BODY)
        wait_for(driver, stage)
        assert end(driver) == driver.move(move).state
        if end is not replace:
            driver.world.advance(1.0)
            assert driver.stays_still()
        driver.ask(SetControlMode(control_mode="auto"))
        assert driver.drive(standard(2.6, 1.5, 0.0)).state == "succeeded"
    assert driver.world.inspect().contact_count == 0


def test_a_planner_that_is_killed_on_the_line_comes_back_standing(driver: JoinedChassis) -> None:
    move = driver.post(BODY)
    wait_for(driver, "on the line")
    driver.restart()
    driver.world.advance(1.0)
    assert driver.stays_still() and driver.planning_state.move_state == "failed"
    assert driver.move(move).fail_reason == MoveFailReason.PLATFORM_ALERT_ERROR
    assert driver.drive(BODY).state == "succeeded"
    assert driver.world.inspect().contact_count == 0


@pytest.mark.parametrize("hold", ["stop", "pause", "velocity"])
def test_a_route_that_is_held_in_every_stage_goes_on_in_it(driver: JoinedChassis, hold: str) -> None:
    def held(on: bool) -> None:
        if hold == "stop":
            driver.ask(SetEmergencyStop(enable=on))
        elif hold == "velocity":  # as integrators hold a robot without cancelling its move
            driver.set_parameters(max_forward_velocity=0.0 if on else 1.2)
        else:
            driver.change(PauseMove(paused=on))

    move = driver.post(BODY)
    off: list[float] = []
    for stage in STAGES:
        wait_for(driver, stage)
        passed = driver.planning_state.passed_points
        held(True)
        driver.world.advance(1.5)
        assert driver.stays_still() and driver.planning_state.move_state == "moving" and driver.planning_state.message
        held(False)
        driver.world.advance(0.2)
        assert (driver.planning_state.passed_points, driver.planning_state.message) == (passed, "")
        if passed:
            pose = driver.world.true_pose(ROBOT)
            off.append(off_line(ROUTE, np.array([pose.x, pose.y])))
    assert driver.finish(move).state == "succeeded"
    pose = driver.world.true_pose(ROBOT)
    assert max(off) < 0.05 and abs(pose.yaw - 1.57) < 0.04
    assert np.hypot(pose.x - ROUTE[-1, 0], pose.y - ROUTE[-1, 1]) < 0.05
    assert driver.world.inspect().contact_count == 0


def truly_off(driver: JoinedChassis, move: int, route: Any) -> list[float]:
    """Metres off the line at each tenth of a second from the first point on, until the move has ended."""
    off: list[float] = []

    def ended() -> bool | None:
        pose = driver.world.true_pose(ROBOT)
        if driver.planning_state.passed_points:
            off.append(off_line(np.array(route), np.array([pose.x, pose.y])))
        return driver.move(move).state != "moving" or None

    driver.world.wait_for(ended, "the route ends", 180.0, step=0.1)
    assert driver.move(move).state == "succeeded", driver.move(move)
    return off


def test_with_a_tolerance_a_crate_is_passed_and_without_one_waited_for(driver: JoinedChassis) -> None:
    route = [(3.0, 1.5), (7.8, 1.5)]
    body = {"type": "along_given_route", "route_coordinates": "3, 1.5, 7.8, 1.5"}
    driver.world.ask(Place(name="crate", pose=Pose2(x=5.0, y=1.5, yaw=0.0), size=(0.5, 0.4, 0.5)))
    off = truly_off(driver, driver.post(body, detour_tolerance=0.6), route)
    assert 0.4 < max(off) <= 0.6 + LOCALISED
    assert driver.drive(standard(2.5, 1.5, 0.0)).state == "succeeded"
    move = driver.post(body)
    driver.world.advance(30.0)
    assert driver.stays_still()
    assert (driver.move(move).state, driver.planning_state.stuck_state) == ("moving", "move_stucked")
    driver.world.ask(Place(name="crate", pose=Pose2(x=5.0, y=2.6, yaw=0.0), size=(0.5, 0.4, 0.5)))
    assert max(truly_off(driver, move, route)) < 0.05
    assert driver.world.inspect().contact_count == 0
