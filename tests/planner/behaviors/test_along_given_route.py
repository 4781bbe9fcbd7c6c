"""Given routes on the plant: the line is kept, obstacles are waited for, faults are named before a wheel turns."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import wrap
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.map.test_grid import feature
from tests.planner.plant import Array, Hall, Plant, Robot, Told, Walker, box, keep_on, off_line

Begin = Callable[..., tuple[Robot, Plant]]
ROUTE = np.array([(2.0, 4.0), (7.0, 4.0), (7.0, 7.0), (4.0, 6.6)])
STRAIGHT = np.array([(2.0, 4.0), (8.5, 4.0)])


def start(robot: Robot, route: Array, **more: Any) -> None:
    text = ", ".join(f"{x}, {y}" for x, y in route)
    robot.begin(MoveCreate(type="along_given_route", **{"route_coordinates": text} | more))


def passed(robot: Robot) -> int:
    assert robot.motion.move is not None
    return robot.motion.move.status().passed_points


def drive(robot: Robot, route: Array, seconds: float) -> list[tuple[int, float, Told]]:
    """Until the end of the route, or so long: passed points, metres off the line, and what was reported, each tick."""
    ticks: list[tuple[int, float, Told]] = []
    plant = robot.plant
    end = plant.seconds + seconds
    while plant.seconds < end:
        told = robot.tick()
        plant.drive(told.twist)
        ticks.append((passed(robot), off_line(route, plant.pose[:2]), told))
        if told.arrived:
            break
    return ticks


def fails_before_moving(robot: Robot, reason: Reason) -> str:
    before = robot.plant.pose.copy()
    with pytest.raises(MoveFailed) as failed:
        keep_on(robot, robot.plant, 2)
    assert failed.value.reason is reason, failed.value.text
    assert np.abs(robot.plant.pose - before).max() < 1e-3, "no wheel has turned"
    return failed.value.text


@pytest.mark.parametrize("yaw", [None, -1.0])
def test_the_line_is_kept_and_every_point_is_passed(begin: Begin, yaw: float | None) -> None:
    robot, plant = begin(Hall(10, 9))
    start(robot, ROUTE, target_ori=yaw)
    ticks = drive(robot, ROUTE, 90)
    assert ticks[-1][2].arrived and plant.contacts == []
    on_line = [off for points, off, _ in ticks if points]
    assert np.median(on_line) < 0.01 and max(on_line) < 0.03
    assert [count for count, _ in itertools.groupby(points for points, _, _ in ticks)] == [0, 1, 2, 3, 4]
    assert math.dist(plant.pose[:2], ROUTE[-1]) < 0.03
    assert abs(wrap(plant.pose[2] - (math.atan2(-0.4, -3.0) if yaw is None else yaw))) < math.radians(3.0)


def test_remaining_distance_is_that_of_the_route(begin: Begin) -> None:
    robot, _ = begin(Hall(10, 9))
    start(robot, ROUTE)
    told = [tick[2] for tick in drive(robot, ROUTE, 90)]
    length = float(np.hypot(*np.diff(ROUTE, axis=0).T).sum())
    left = np.array([t.remaining_distance for t in told])
    assert left[3] == pytest.approx(length + 0.5, abs=0.1) and left[-1] == 0.0
    assert (np.diff(left) < 0.06).all()
    assert all(len(t.path) for t in told[2:-5])


def test_a_smooth_curve_is_driven_without_stopping(begin: Begin) -> None:
    robot, plant = begin(Hall(12, 9), pose=(2.0, 3.0, 0.0))
    angles = np.linspace(-math.pi / 2, math.pi / 2, 24)
    curve = np.column_stack([6.0 + 2.0 * np.cos(angles), 4.0 + 2.0 * np.sin(angles)])
    route = np.vstack([[(2.5, 2.0)], curve, [(2.5, 6.0)]])
    start(robot, route)
    speeds: list[float] = []
    offs: list[float] = []
    while not (told := robot.tick()).arrived:
        plant.drive(told.twist)
        if plant.pose[0] > 3.5 and passed(robot):
            speeds.append(plant.v)
            offs.append(off_line(route, plant.pose[:2]))
    assert min(speeds) > 0.3 and max(offs) < 0.03


def test_it_waits_for_a_crate_as_long_as_it_is_there(begin: Begin) -> None:
    """Longer than any timeout of a standard move, which would fail; the state says that it is stuck."""
    settings = NavigationSettings(move_timeout=6.0, planning_timeout=6.0, stuck_after=2.0)
    robot, plant = begin(Hall(10, 8), settings=settings, crates=(box(5.0, 4.0, 0.5, 0.5),))
    start(robot, STRAIGHT, detour_tolerance=0.0)
    ticks = drive(robot, STRAIGHT, 40)
    assert not ticks[-1][2].arrived and abs(plant.v) < 1e-3
    gap = 5.0 - 0.25 - (plant.pose[0] + 0.375)
    assert 0.2 < gap < 0.5
    assert (ticks[-1][2].stuck_state, ticks[-1][2].viewport_blocked) == ("move_stucked", True)
    plant.crates = []
    ticks += drive(robot, STRAIGHT, 60)
    assert ticks[-1][2].arrived and ticks[-1][2].stuck_state == "none" and plant.contacts == []
    assert max(off for points, off, _ in ticks if points) < 0.03


def test_it_waits_for_somebody_who_crosses_and_does_not_make_way(begin: Begin) -> None:
    walker = Walker(np.array([(5.5, 1.0), (5.5, 7.0)]), 0.5, polite=True)
    robot, plant = begin(Hall(10, 8), walkers=(walker,))
    start(robot, STRAIGHT)
    ticks = drive(robot, STRAIGHT, 90)
    assert ticks[-1][2].arrived and plant.contacts == []
    assert max(off for points, off, _ in ticks if points) < 0.03


def test_a_corner_beside_an_obstacle_waits_until_it_can_turn(begin: Begin) -> None:
    robot, plant = begin(Hall(10, 9), crates=(box(7.0, 4.42, 0.5, 0.3),))
    start(robot, ROUTE)
    drive(robot, ROUTE, 30)
    assert plant.contacts == [] and abs(plant.w) < 1e-3 and passed(robot) in (1, 2)
    plant.crates = []
    assert drive(robot, ROUTE, 60)[-1][2].arrived


def test_a_hold_goes_on_where_it_was(begin: Begin) -> None:
    robot, plant = begin(Hall(10, 9))
    start(robot, ROUTE)
    for _ in range(3):
        drive(robot, ROUTE, 6)
        before = passed(robot)
        for _ in range(60):
            plant.drive(robot.hold())
        assert abs(plant.v) < 1e-3
        told = robot.tick()
        plant.drive(told.twist)
        assert passed(robot) >= before and told.stuck_state == "none"
    assert drive(robot, ROUTE, 60)[-1][2].arrived


def test_pushed_off_the_line_it_drives_back_to_where_it_was(begin: Begin) -> None:
    robot, plant = begin(Hall(10, 9))
    start(robot, ROUTE)
    drive(robot, ROUTE, 6)
    for _ in range(30):
        plant.drive(robot.hold())
    plant.pose += (0.2, -0.6, 0.5)
    for _ in range(30):
        plant.drive(robot.hold())
    ticks = drive(robot, ROUTE, 90)
    assert ticks[-1][2].arrived
    back = next(k for k, (_, off, _) in enumerate(ticks) if off < 0.02)
    assert max(off for _, off, _ in ticks[back + 50 :]) < 0.03


def test_move_timeout_when_wheels_are_blocked_on_the_line(begin: Begin) -> None:
    robot, plant = begin(Hall(10, 8), settings=NavigationSettings(move_timeout=4.0))
    start(robot, STRAIGHT)
    drive(robot, STRAIGHT, 5)
    plant.wheels_blocked = True
    with pytest.raises(MoveFailed) as failed:
        drive(robot, STRAIGHT, 30)
    assert failed.value.reason is Reason.MOVE_TIMEOUT


def test_a_slow_zone_is_driven_slowly(begin: Begin) -> None:
    ring = [[4, 3], [6, 3], [6, 5], [4, 5]]
    robot, plant = begin(Hall(10, 8, overlays=[feature("Polygon", [ring], regionType=2)]))
    start(robot, STRAIGHT)
    fastest = 0.0
    while not (told := robot.tick()).arrived:
        plant.drive(told.twist)
        fastest = max(fastest, plant.v if 4.4 < plant.pose[0] < 6.0 else 0.0)
    assert 0.3 < fastest < 0.45


@pytest.mark.parametrize("text", [None, "1, 2, 3", "1, 2", "a, b, c, d"])
def test_a_malformed_route_is_reason_400(begin: Begin, text: str | None) -> None:
    robot, _ = begin(Hall(10, 8))
    start(robot, STRAIGHT, route_coordinates=text)
    assert "route_coordinates: " in fails_before_moving(robot, Reason.INVALID_TRACK_POINTS)


def test_too_far_from_the_first_point_is_reason_401(begin: Begin) -> None:
    robot, plant = begin(Hall(20, 8))
    start(robot, np.add(STRAIGHT, (5.0, 0.0)))
    text = fails_before_moving(robot, Reason.TOO_FAR_FROM_START_OF_TRACK)
    assert " m from the first point of the route (7.00, 4.00), expected at most 5.00 m" in text
    start(robot, np.add(STRAIGHT, (4.4, 0.0)))
    assert drive(robot, np.add(STRAIGHT, (4.4, 0.0)), 60)[-1][2].arrived and plant.contacts == []


OFF_MAP = (
    [(2.0, 4.0), (30.0, 4.0)],
    Reason.ENDING_POINT_OUT_OF_MAP,
    "point 2 of the route: the goal is at (30.00, ",
)
IN_BLOCK = (
    [(2.0, 4.0), (5.0, 4.0)],
    Reason.ENDING_POINT_NOT_IN_GROUND,
    "point 2 of the route: the goal is at (5.00, ",
)
THROUGH_BLOCK = [(2.0, 4.0), (8.0, 4.0)], Reason.CALCULATION_FAILED, "on the line after point 1 of the route, at (4."
AT_WALL = [(2.0, 4.0), (2.0, 0.5), (6.0, 0.5)], Reason.CALCULATION_FAILED, "after point 1 of the route, at (2.00, 0."


@pytest.mark.parametrize(("route", "reason", "text"), [OFF_MAP, IN_BLOCK, THROUGH_BLOCK, AT_WALL])
def test_a_route_that_the_map_forbids_fails_before_a_wheel_turns(
    begin: Begin, route: list[tuple[float, float]], reason: Reason, text: str
) -> None:
    robot, _ = begin()  # with a block in the middle of the hall
    start(robot, np.array(route))
    assert text in fails_before_moving(robot, reason)


def test_a_corner_without_room_to_turn_fails_before_a_wheel_turns(begin: Begin) -> None:
    """The line itself is free: a slot of 0.6 m, and back again."""
    slot = [box(4.6, 5.3, 5.2, 2.0), box(4.6, 2.7, 5.2, 2.0)]
    robot, _ = begin(Hall(10, 8, slot))
    route = np.array([(2.0, 4.0), (6.0, 4.0), (2.0, 4.0)])
    start(robot, route)
    assert "cannot turn by 180° at point 2" in fails_before_moving(robot, Reason.CALCULATION_FAILED)


def goes_round(ticks: list[tuple[int, float, Told]], tolerance: float) -> None:
    assert ticks[-1][2].arrived
    off = [off for points, off, _ in ticks if points]
    assert 0.3 < max(off) <= tolerance
    assert any(told.replanned or told.remaining_distance > 0 for _, _, told in ticks)


def test_with_a_tolerance_it_goes_round_a_crate_and_back_onto_the_line(begin: Begin) -> None:
    route = np.array([(2.0, 4.0), (12.0, 4.0)])
    robot, plant = begin(Hall(14, 8), crates=(box(6.0, 4.0, 0.5, 0.5),))
    start(robot, route, detour_tolerance=0.6)
    ticks: list[tuple[int, float, Told]] = []
    places: list[tuple[float, float]] = []
    while not (ticks and ticks[-1][2].arrived):
        told = robot.tick()
        plant.drive(told.twist)
        ticks.append((passed(robot), off_line(route, plant.pose[:2]), told))
        places.append((plant.pose[0], plant.pose[1]))
        assert plant.seconds < 90
    goes_round(ticks, 0.6)
    assert plant.contacts == []
    behind = [abs(y - 4.0) for x, y in places if x > 6.25 + 2.0]
    assert max(behind) < 0.05, "back on the line within 2 m"


def test_a_tolerance_that_is_too_small_waits_and_fails_in_the_end(begin: Begin) -> None:
    settings = NavigationSettings(planning_timeout=8.0)
    robot, plant = begin(Hall(10, 8), settings=settings, crates=(box(5.0, 4.0, 0.5, 0.8),))
    start(robot, STRAIGHT, detour_tolerance=0.5)
    with pytest.raises(MoveFailed, match=r"no way round for 8 s within detour_tolerance 0\.50 m") as failed:
        drive(robot, STRAIGHT, 40)
    assert failed.value.reason is Reason.PLANNING_TIMEOUT
    assert off_line(STRAIGHT, plant.pose[:2]) < 0.05 and plant.contacts == []


def test_a_crate_on_a_corner_is_gone_round(begin: Begin) -> None:
    route = np.array([(2.0, 3.0), (7.0, 3.0), (7.0, 8.0)])
    robot, plant = begin(Hall(10, 10), pose=(1.5, 3.0, 0.0), crates=(box(7.0, 3.0, 0.4, 0.4),))
    start(robot, route, detour_tolerance=0.9)
    ticks = drive(robot, route, 90)
    goes_round(ticks, 0.9)
    assert plant.contacts == [] and ticks[-1][0] == 3
