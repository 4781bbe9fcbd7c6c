"""Following a target on the plant: distance, reports of each kind, silence, obstacles, and every way to fail."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rackhand.schemas.chassis import FollowTarget
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import wrap
from rackhand.services.planner.perception.chassis_state import Followed
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import Array, Hall, Plant, Robot, Walker, box

Begin = Callable[..., tuple[Robot, Plant]]
WANTED = NavigationSettings().follow_distance
PERIOD = 0.32  # s between reports


def report(robot: Robot, state: str = "follow_pose", **fields: Any) -> None:
    target = FollowTarget(state=state, **fields)  # type: ignore[arg-type]
    robot.state.followed = Followed(robot.plant.stamp, target)


def follow(
    robot: Robot, seconds: float, target: Callable[[float], Array | None], yaw: float | None = None
) -> list[tuple[float, float]]:
    """Report where the target is every ``PERIOD`` s; None: no report. Returns time and true distance at each tick."""
    plant = robot.plant
    begun, ticks = plant.seconds, []
    while plant.seconds < begun + seconds:
        place = target(plant.seconds - begun)
        if place is not None and len(ticks) % round(PERIOD / 0.04) == 0:
            report(robot, position=(float(place[0]), float(place[1])), yaw=yaw)
        plant.drive(robot.tick().twist)
        away = math.nan if place is None else math.dist(plant.pose[:2], place)
        ticks.append((plant.seconds - begun, away))
    return ticks


def start(robot: Robot) -> None:
    robot.begin(MoveCreate(type="follow_target"))


def still_at(x: float, y: float) -> Callable[[float], Array | None]:
    return lambda _seconds: np.array([x, y])


def figure_eight(speed: float) -> Array:
    """A closed lemniscate of about 20 m about (7, 4.5), as waypoints."""
    t = np.linspace(0.0, 2.0 * math.pi, 160)
    return np.column_stack([7.0 + 4.0 * np.sin(t), 4.5 + 2.4 * np.sin(t) * np.cos(t)])


def test_the_distance_is_kept_on_a_figure_eight(begin: Begin) -> None:
    walker = Walker(figure_eight(0.6), 0.6)
    robot, plant = begin(Hall(14, 9), pose=(5.6, 3.7, 0.6), walkers=(walker,))
    start(robot)
    ticks = follow(robot, 60, lambda _: walker.position)
    distances = [away for seconds, away in ticks if seconds > 6.0]
    assert plant.contacts == []
    assert max(distances) < WANTED + 0.3 and min(distances) > WANTED - 0.3


def test_it_stops_at_the_distance_and_faces_the_target(begin: Begin) -> None:
    robot, plant = begin(Hall(10, 8), walkers=(Walker(np.array([(6.0, 5.0), (6.0, 5.0)]), 0.0),))
    start(robot)
    follow(robot, 20, still_at(6.0, 5.0))
    assert math.dist(plant.pose[:2], (6.0, 5.0)) == pytest.approx(WANTED, abs=0.15)
    follow(robot, 10, still_at(float(plant.pose[0]), float(plant.pose[1]) + 1.2))
    assert abs(wrap(plant.pose[2] - math.pi / 2)) < 0.35 and abs(plant.v) < 1e-3
    assert plant.contacts == []


def test_a_target_that_comes_nearer_is_not_backed_away_from(begin: Begin) -> None:
    robot, plant = begin(Hall(10, 8))
    start(robot)
    follow(robot, 10, still_at(4.0, 4.0))
    before = plant.pose.copy()
    follow(robot, 5, still_at(plant.pose[0] + 0.7, 4.0))
    assert np.hypot(*(plant.pose - before)[:2]) < 0.02


def test_with_a_heading_it_takes_that_at_rest(begin: Begin) -> None:
    robot, plant = begin(Hall(10, 8))
    start(robot)
    follow(robot, 20, still_at(5.0, 4.0), yaw=-2.0)
    assert abs(wrap(plant.pose[2] + 2.0)) < 0.06
    assert math.dist(plant.pose[:2], (5.0, 4.0)) == pytest.approx(WANTED, abs=0.15)


def test_a_heading_alone_is_turned_to_on_the_spot(begin: Begin) -> None:
    robot, plant = begin(Hall(10, 8))
    start(robot)
    before = plant.pose.copy()
    for _ in range(200):
        report(robot, yaw=2.2)
        plant.drive(robot.tick().twist)
    assert abs(wrap(plant.pose[2] - 2.2)) < 0.06 and np.hypot(*(plant.pose - before)[:2]) < 0.02


def test_pause_holds_still_however_long_and_then_goes_on(begin: Begin) -> None:
    robot, plant = begin(Hall(14, 8))
    start(robot)
    follow(robot, 4, still_at(12.0, 4.0))
    assert plant.v > 0.5
    report(robot, "pause")
    for _ in range(40 * 25):
        plant.drive(robot.tick().twist)
    assert abs(plant.v) < 1e-3
    follow(robot, 20, still_at(12.0, 4.0))
    assert math.dist(plant.pose[:2], (12.0, 4.0)) < WANTED + 0.15


def test_a_client_that_falls_silent_stops_it_and_may_come_back(begin: Begin) -> None:
    robot, plant = begin(Hall(14, 8))
    start(robot)
    follow(robot, 4, still_at(12.0, 4.0))
    follow(robot, 4, lambda _: None)
    assert abs(plant.v) < 1e-3
    follow(robot, 4, still_at(12.0, 4.0))
    assert plant.v > 0.3
    with pytest.raises(MoveFailed, match="no /follow_target_state for 10 s") as failed:
        follow(robot, 12, lambda _: None)
    assert failed.value.reason is Reason.FOLLOW_FAILED and abs(plant.v) < 1e-3


def test_without_any_report_it_fails(begin: Begin) -> None:
    robot, _ = begin(Hall(10, 8))
    start(robot)
    with pytest.raises(MoveFailed, match="no /follow_target_state") as failed:
        follow(robot, 12, lambda _: None)
    assert failed.value.reason is Reason.FOLLOW_FAILED


def test_fail_ends_the_move(begin: Begin) -> None:
    robot, _ = begin(Hall(10, 8))
    start(robot)
    follow(robot, 2, still_at(5.0, 4.0))
    report(robot, "fail")
    with pytest.raises(MoveFailed, match="follow_state 'fail'") as failed:
        robot.tick()
    assert failed.value.reason is Reason.FOLLOW_FAILED


def test_through_a_narrow_gap_and_behind_an_obstacle(begin: Begin) -> None:
    """A wall with a gap of 0.8 m: the target goes through it and stands behind the wall, out of sight."""
    hall = Hall(12, 8, [box(6.0, 1.7, 0.3, 3.0), box(6.0, 6.0, 0.3, 4.0)])
    walker = Walker(np.array([(4.0, 3.6), (7.5, 3.6), (7.5, 6.5), (7.5, 6.5)]), 0.5)
    robot, plant = begin(hall, pose=(2.5, 3.6, 0.0), walkers=(walker,))
    start(robot)
    standing = walker.points[-1]

    def where(_seconds: float) -> Array:
        if math.dist(walker.position, standing) < 0.05:
            walker.speed = 0.0
        return walker.position

    follow(robot, 45, where)
    assert plant.contacts == []
    assert plant.pose[0] > 6.3 and math.dist(plant.pose[:2], standing) < WANTED + 0.2


def test_a_target_that_is_too_fast_is_chased_at_full_speed(begin: Begin) -> None:
    robot, plant = begin(Hall(30, 8), pose=(1.5, 4.0, 0.0))
    start(robot)
    follow(robot, 10, lambda seconds: np.array([min(3.0 + 2.0 * seconds, 28.0), 4.0]))
    assert plant.v > 1.0
    follow(robot, 25, still_at(28.0, 4.0))
    assert math.dist(plant.pose[:2], (28.0, 4.0)) == pytest.approx(WANTED, abs=0.2)


@pytest.mark.parametrize(("x", "y"), [(50.0, 4.0), (5.0, 4.0)])
def test_a_target_that_cannot_be_reached_is_waited_for_and_lost_in_the_end(begin: Begin, x: float, y: float) -> None:
    """Outside the map, or in a closed room."""
    room = [box(5.0, 2.4, 3.4, 0.2), box(5.0, 5.6, 3.4, 0.2), box(3.4, 4.0, 0.2, 3.4), box(6.6, 4.0, 0.2, 3.4)]
    robot, plant = begin(Hall(10, 8, room), settings=NavigationSettings(planning_timeout=6.0))
    start(robot)
    with pytest.raises(MoveFailed, match="was not reached for 6 s: no p") as failed:
        follow(robot, 20, still_at(x, y))
    assert failed.value.reason is Reason.FOLLOW_FAILED
    assert np.hypot(*(plant.pose[:2] - (1.5, 4.0))) < 0.05


def test_a_target_at_a_wall_is_approached(begin: Begin) -> None:
    robot, plant = begin(Hall(10, 8))
    start(robot)
    follow(robot, 25, still_at(5.0, 7.75))
    assert math.dist(plant.pose[:2], (5.0, 7.75)) < WANTED + 0.2 and plant.contacts == []


def test_move_timeout_when_wheels_are_blocked(begin: Begin) -> None:
    robot, plant = begin(Hall(14, 8), settings=NavigationSettings(move_timeout=5.0))
    start(robot)
    follow(robot, 3, still_at(12.0, 4.0))
    plant.wheels_blocked = True
    with pytest.raises(MoveFailed) as failed:
        follow(robot, 10, still_at(12.0, 4.0))
    assert failed.value.reason is Reason.MOVE_TIMEOUT


def test_a_hold_is_no_silence(begin: Begin) -> None:
    robot, plant = begin(Hall(14, 8))
    start(robot)
    follow(robot, 3, still_at(12.0, 4.0))
    for _ in range(20 * 25):
        plant.drive(robot.hold())
    follow(robot, 20, still_at(12.0, 4.0))
    assert math.dist(plant.pose[:2], (12.0, 4.0)) < WANTED + 0.15
