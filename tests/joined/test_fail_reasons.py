"""Reasons that a standard move fails for at once or while it drives, each raised by its cause in the world.

Those that come after a minute of patience are scenarios of the world ``empty`` (tests/system/test_scenarios.py).
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PIL import Image

from rackhand.schemas.base import Pose2
from rackhand.schemas.explain import Explanation
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.world import InjectFault
from tests.joined.chassis import JoinedChassis
from tests.joined.world import JoinedWorld
from tests.system.driving import no_go, square, standard, wall

ROBOT = "amr1"


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[JoinedChassis]:
    """A chassis at rest at its start in an empty hall."""
    with JoinedWorld("empty", tmp_path, seed=1, with_arms=False) as world:
        world.advance(0.4)
        yield world.chassis()


def start(driver: JoinedChassis) -> Pose2:
    return driver.world.true_pose(ROBOT)


def png(width: int, height: int) -> bytes:
    """A picture of free ground."""
    file = io.BytesIO()
    Image.new("L", (width, height), 254).save(file, "PNG")
    return file.getvalue()


def ahead(driver: JoinedChassis, metres: float) -> dict[str, object]:
    """A move to a point ahead of the robot, its heading kept."""
    pose = start(driver)
    return standard(pose.x + metres, pose.y, 0.0)


def fault(driver: JoinedChassis, name: str) -> None:
    driver.world.ask(InjectFault(target=ROBOT, fault=name))  # type: ignore[arg-type]


def no_map(driver: JoinedChassis) -> int:
    driver.use_no_map()
    return driver.post(ahead(driver, 3.0))


def robot_beside_the_map(driver: JoinedChassis) -> int:
    pose = start(driver)
    driver.use_map(png(100, 100), pose.x + 2.0, pose.y - 2.5, 0.05)
    return driver.post(standard(pose.x + 4.0, pose.y, 0.0))


def goal_beside_the_map(driver: JoinedChassis) -> int:
    return driver.post(standard(500.0, 0.0, 0.0))


def robot_in_a_no_go_zone(driver: JoinedChassis) -> int:
    pose = start(driver)
    driver.overlay(no_go(*square(pose.x, pose.y, 1.0)))
    return driver.post(ahead(driver, 3.0))


def goal_in_a_no_go_zone(driver: JoinedChassis) -> int:
    pose = start(driver)
    driver.overlay(no_go(*square(pose.x + 3.0, pose.y, 0.8)))
    return driver.post(ahead(driver, 3.0))


def nothing_to_drive_and_nothing_to_turn_to(driver: JoinedChassis) -> int:
    pose = start(driver)
    return driver.post(standard(pose.x, pose.y, properties={"inplace_rotate": True}))


def goal_behind_virtual_walls(driver: JoinedChassis) -> int:
    pose = start(driver)
    corners = square(pose.x + 3.0, pose.y, 1.2)
    driver.overlay(wall(*corners, corners[0]))
    return driver.post(ahead(driver, 3.0))


def lidar(kind: str) -> Callable[[JoinedChassis], int]:
    def cause(driver: JoinedChassis) -> int:
        move = driver.post(ahead(driver, 4.0))
        driver.wait_until_moving()
        fault(driver, kind)
        return move

    return cause


def cable_plugged_in(driver: JoinedChassis) -> int:
    fault(driver, "power_cable")
    return driver.post(ahead(driver, 3.0))


def map_changed_while_driving(driver: JoinedChassis) -> int:
    move = driver.post(ahead(driver, 4.0))
    driver.wait_until_moving()
    driver.use_stored_map()
    return move


def deprecated_type(driver: JoinedChassis) -> int:
    return driver.post({"creator": "test", "type": "leave_elevator", "target_x": 1.0, "target_y": 0.0})


# What ``explain`` must name: the kind of thing at a place (metres from the start), or words of the cause.
EXPLAINED: dict[str, tuple[str, tuple[float, float] | None]] = {
    "no_map": ("no map is in use", None),
    "robot_beside_the_map": ("edge of the map", (2.0, 0.0)),
    "goal_beside_the_map": ("edge of the map", None),
    "robot_in_a_no_go_zone": ("no-go zone", (0.0, 0.0)),
    "goal_in_a_no_go_zone": ("no-go zone", (3.0, 0.0)),
    "nothing_to_drive_and_nothing_to_turn_to": ("no rotation to make", None),
    "goal_behind_virtual_walls": ("virtual wall", (2.4, 0.0)),
    "lidar.<locals>.cause": ("no usable scan", None),
    "cable_plugged_in": ("power cable", None),
    "map_changed_while_driving": ("the map was changed", None),
    "deprecated_type": ("deprecated", None),
}
NEAR = 1.0  # m between where a thing was put and where it is named: things have sizes


CAUSES: list[tuple[Reason, Callable[[JoinedChassis], int]]] = [
    (Reason.GET_MAP_FAILED, no_map),
    (Reason.STARTING_POINT_OUT_OF_MAP, robot_beside_the_map),
    (Reason.ENDING_POINT_OUT_OF_MAP, goal_beside_the_map),
    (Reason.STARTING_POINT_NOT_IN_GROUND, robot_in_a_no_go_zone),
    (Reason.ENDING_POINT_NOT_IN_GROUND, goal_in_a_no_go_zone),
    (Reason.STARTING_EQUAL_ENDING, nothing_to_drive_and_nothing_to_turn_to),
    (Reason.CALCULATION_FAILED, goal_behind_virtual_walls),
    (Reason.CONTROL_COSTMAP_ERROR, lidar("lidar_dead")),
    (Reason.CONTROL_COSTMAP_ERROR, lidar("lidar_blind")),
    (Reason.POWER_CABLE_CONNECTED, cable_plugged_in),
    (Reason.MAP_CHANGED, map_changed_while_driving),
    (Reason.MOVE_ACTION_TYPE_DEPRECATED, deprecated_type),
]


@pytest.mark.parametrize(("reason", "cause"), CAUSES, ids=lambda value: getattr(value, "rest_name", ""))
def test_a_move_fails_for_its_cause(
    driver: JoinedChassis, reason: Reason, cause: Callable[[JoinedChassis], int]
) -> None:
    began = start(driver)
    move = driver.finish(cause(driver))
    assert (move.state, move.fail_reason) == ("failed", reason), move
    assert move.fail_message, "a failure says what, where and by how much"
    assert driver.world.inspect().contact_count == 0
    check_explained(driver.explain(move.id), began, *EXPLAINED[cause.__qualname__])


def check_explained(explanation: Explanation, began: Pose2, what: str, where: tuple[float, float] | None) -> None:
    assert explanation.verdict == "failed" and explanation.advice
    assert what in explanation.cause, explanation.cause
    things = explanation.evidence.things
    if where is None:
        assert not things or things[0].kind == what, things
        return
    (thing,) = things
    assert thing.kind == what
    assert math.hypot(thing.x - began.x - where[0], thing.y - began.y - where[1]) < NEAR, thing
    assert thing.clearance is not None and thing.needed is not None and thing.clearance < thing.needed, thing


def test_after_every_failure_the_next_move_succeeds(driver: JoinedChassis) -> None:
    driver.finish(deprecated_type(driver))
    assert driver.drive(ahead(driver, 2.0)).state == "succeeded"


def test_a_repeated_target_succeeds_again_at_once(driver: JoinedChassis) -> None:
    target = ahead(driver, 2.0)
    assert driver.drive(target).state == "succeeded"
    place = start(driver)
    assert driver.drive(target).state == "succeeded"
    assert start(driver).x == pytest.approx(place.x, abs=1e-3), "no wheel has turned"
