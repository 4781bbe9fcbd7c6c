"""Close to walls, crates and people: in and out again, near enough, and with the same patience whoever came first."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.world import MoveRobot, Place, Remove
from rackhand.services.planner.settings import NavigationSettings
from rackhand.testing import distance
from tests.joined.chassis import JoinedChassis
from tests.joined.places import write_place
from tests.joined.world import JoinedWorld
from tests.system.driving import no_go, square, standard

PATIENCE = 15.0  # s
HALL = (-10.5, -6.5, 10.5, 6.5)


def wall(x0: float, y0: float, x1: float, y1: float) -> dict[str, Any]:
    return {"kind": "wall", "start": [x0, y0], "end": [x1, y1], "thickness": 0.2}


WALLS = {
    "east": wall(10.1, -6, 10.1, 6),
    "west": wall(-10.1, -6, -10.1, 6),
    "north": wall(-10, 6.1, 10, 6.1),
    "south": wall(-10, -6.1, 10, -6.1),
}


@pytest.fixture
def driver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[JoinedChassis]:
    """A chassis at rest in the middle of a walled hall of 20 x 12 m."""
    yield from hall(tmp_path, monkeypatch, NavigationSettings())


@pytest.fixture
def impatient(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[JoinedChassis]:
    """The same, with a quarter of the patience, so that its end is soon seen."""
    yield from hall(tmp_path, monkeypatch, NavigationSettings(planning_timeout=PATIENCE))


def hall(path: Path, monkeypatch: pytest.MonkeyPatch, navigation: NavigationSettings) -> Iterator[JoinedChassis]:
    name = write_place(path / "worlds", monkeypatch, "hall", HALL, WALLS)
    with JoinedWorld(name, path, seed=1, navigation=navigation) as world:
        world.advance(0.4)
        yield world.chassis()


def put(driver: JoinedChassis, x: float, y: float, yaw: float) -> None:
    driver.world.ask(MoveRobot(robot="amr1", pose=Pose2(x=x, y=y, yaw=yaw)))
    driver.world.advance(0.6)


def crate(driver: JoinedChassis, name: str, x: float, y: float, length: float, width: float) -> None:
    driver.world.ask(Place(name=name, pose=Pose2(x=x, y=y, yaw=0.0), size=(length, width, 0.6)))


@pytest.mark.parametrize(
    ("x", "y", "yaw"),
    [(9.66, 0.0, -1.5708), (9.68, 1.0, 1.5708), (0.0, 5.69, 0.0), (9.58, 5.68, 0.0), (-9.58, -5.68, 0.0)],
    ids=["9 cm beside a wall", "7 cm, the other way", "8 cm", "in a corner", "in a corner, tail to the wall"],
)
def test_where_it_can_be_parked_it_can_leave(x: float, y: float, yaw: float, driver: JoinedChassis) -> None:
    put(driver, x, y, yaw)
    move = driver.drive(standard(0.0, 0.0), within=60.0)
    assert move.state == "succeeded", move
    assert driver.world.inspect().contact_count == 0


def test_in_beside_a_wall_and_out_again(driver: JoinedChassis) -> None:
    for goal in ((9.68, 0.0, -1.5708), (4.0, 2.0, None)):
        move = driver.drive(standard(*goal), within=60.0)
        assert move.state == "succeeded", move
    assert driver.world.inspect().contact_count == 0


@pytest.mark.parametrize("gap", [0.006, 0.01, 0.016])
@pytest.mark.parametrize("accuracy", [None, 0.3])
def test_a_goal_with_the_nose_to_a_wall_ends(gap: float, accuracy: float | None, driver: JoinedChassis) -> None:
    put(driver, 6.0, 0.0, 0.0)
    begun = driver.world.now()
    move = driver.drive(standard(10.0 - 0.375 - gap, 0.0, 0.0, target_accuracy=accuracy), within=250.0)
    assert move.state == "succeeded", move
    assert driver.world.now() - begun < 60.0
    assert driver.world.inspect().contact_count == 0


@pytest.mark.parametrize(
    ("x", "yaw"), [(0.392, 0.0), (-0.392, 0.0), (0.387, 0.5)], ids=["at the nose", "at the tail", "at a corner"]
)
def test_with_a_crate_against_it_it_leaves(x: float, yaw: float, driver: JoinedChassis) -> None:
    crate(driver, "crate", x + (0.3 if x > 0 else -0.3), 0.0, 0.6, 0.6)
    driver.world.advance(0.5)
    for goal in ((-4.0, 0.0), (4.0, 2.0)):
        move = driver.drive(standard(*goal), within=60.0)
        assert move.state == "succeeded", move
    assert driver.world.inspect().contact_count == 0


def test_with_a_no_go_zone_at_the_nose_it_leaves(driver: JoinedChassis) -> None:
    driver.overlay(no_go(*square(1.40, 0.0, 1.0)))
    move = driver.drive(standard(4.0, 0.0), within=60.0)
    assert move.state == "succeeded", move


@pytest.mark.parametrize(("goal", "stays"), [(-4.0, 40.0), (5.0, 15.0)])
def test_a_person_on_the_goal_is_waited_for_seen_or_not(goal: float, stays: float, driver: JoinedChassis) -> None:
    put(driver, -7.0, 0.0, 0.0)
    driver.world.ask(Place(name="p", kind="person", pose=Pose2(x=goal, y=0.0, yaw=0.0)))
    driver.world.advance(2.0)
    move = driver.post(standard(goal, 0.0))
    driver.world.advance(stays)
    driver.world.ask(Remove(name="p"))
    assert driver.finish(move, within=60.0).state == "succeeded", driver.move(move)
    assert distance(driver.world.true_pose("amr1"), goal, 0.0) < 0.05


def test_makes_room_for_a_person_who_waits_for_it_on_the_goal(driver: JoinedChassis) -> None:
    """People stop for a robot right in front of them: each would wait for the other to leave."""
    put(driver, 1.0, 0.2, 3.14159)
    begin, end = Pose2(x=-0.7, y=0.0, yaw=0.0), Pose2(x=9.0, y=0.0, yaw=0.0)
    driver.world.ask(Place(name="p", kind="person", pose=begin, walk=(begin, end), speed=0.9))
    driver.world.advance(1.0)
    move = driver.drive(standard(0.1, 0.2), within=40.0)
    assert move.state == "succeeded", move
    assert driver.world.inspect().contact_count == 0


def test_backs_out_from_beside_a_person_who_stands_so_close_that_it_cannot_turn(driver: JoinedChassis) -> None:
    put(driver, 1.0, 0.0, 3.03)
    driver.world.ask(Place(name="p", kind="person", pose=Pose2(x=0.74, y=-0.5, yaw=0.0)))
    move = driver.drive(standard(4.0, 2.0), within=40.0)
    assert move.state == "succeeded", move
    assert driver.world.inspect().contact_count == 0


@pytest.mark.parametrize("goal", [-4.0, 3.0])
def test_a_crate_on_the_goal_for_good_is_14_seen_or_not(goal: float, impatient: JoinedChassis) -> None:
    put(impatient, -7.0, 0.0, 0.0)
    crate(impatient, "crate", goal, 0.0, 0.5, 0.5)
    impatient.world.advance(1.0)
    begun = impatient.world.now()
    move = impatient.drive(standard(goal, 0.0), within=60.0)
    assert impatient.world.now() - begun >= PATIENCE
    assert (move.state, move.fail_reason) == ("failed", Reason.PLANNING_TIMEOUT), move


def test_a_zone_with_an_occupied_middle_is_reached_at_its_rim(driver: JoinedChassis) -> None:
    crate(driver, "crate", 3.0, 0.0, 0.6, 0.6)
    driver.world.advance(0.5)
    zone = {"use_target_zone": True, "target_accuracy": 1.5}
    assert driver.drive(standard(3.0, 0.0, **zone), within=40.0).state == "succeeded"
    driver.overlay(no_go(*square(-3.0, 0.0, 1.0)))
    assert driver.drive(standard(-3.0, 0.0, **zone), within=40.0).state == "succeeded"
    assert distance(driver.world.true_pose("amr1"), -3.0, 0.0) <= 1.52
    move = driver.drive(standard(-3.0, 0.0, use_target_zone=True, target_accuracy=0.3), within=5.0)
    assert (move.state, move.fail_reason) == ("failed", Reason.ENDING_POINT_NOT_IN_GROUND), move
