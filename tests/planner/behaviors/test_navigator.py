"""Whole moves on the plant: arrival, limits, people, faults and the reasons to give up."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from rackhand.schemas.base import Twist2
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.services.planner.behaviors.navigator import ChassisNavigator
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import STANDSTILL, wrap
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.control.test_braking_guard import check_step
from tests.planner.map.test_grid import feature
from tests.planner.plant import TICK, Hall, Plant, Walker, box, idle, keep_on, run


def away(plant: Plant, goal: Goal) -> tuple[float, float]:
    yaw = 0.0 if goal.yaw is None else wrap(plant.pose[2] - goal.yaw)
    return math.hypot(plant.pose[0] - (goal.x or 0.0), plant.pose[1] - (goal.y or 0.0)), abs(yaw)


def fails(navigator: ChassisNavigator, plant: Plant, reason: Reason, seconds: float = 30) -> str:
    with pytest.raises(MoveFailed) as failed:
        keep_on(navigator, plant, seconds)
    assert failed.value.reason is reason, failed.value.text
    return failed.value.text


@pytest.mark.parametrize("seed", range(3))
def test_arrives_within_5_cm_and_2_degrees_of_the_true_pose(begin, seed: int) -> None:
    navigator, plant = begin(seed=seed)
    for goal in (Goal(8.5, 6.5, 2.0), Goal(8.5, 1.2, -1.0), Goal(8.3, 1.2, -1.0)):
        told = run(navigator, plant, goal, 60)
        distance, yaw = away(plant, goal)
        assert distance < 0.03 and yaw < math.radians(1.5)
        assert told[-1].remaining_distance == 0.0 and told[-1].stuck_state == "none"
    assert plant.contacts == []


@pytest.mark.parametrize("stale", [0.04, 0.4])
def test_another_run_of_the_driver_is_driven_as_if_it_were_the_first(begin, stale: float) -> None:
    """Also where its first stamps are those of the former run: what was measured then must not weigh in."""
    navigator, plant = begin()
    first = run(navigator, plant, Goal(3.0, 4.0), 30)
    navigator.reset()
    idle(navigator, Plant(plant.hall, (1.6, 4.1, 0.1), seed=2), stale)
    navigator.reset()
    plant = Plant(plant.hall, (1.5, 4.0, 0.0), seed=1)
    navigator.set_map(plant.hall.map())
    idle(navigator, plant, 0.4)
    again = run(navigator, plant, Goal(3.0, 4.0), 30)
    assert [progress.twist for progress in again] == [progress.twist for progress in first]


def test_remaining_distance_shrinks_with_the_path(begin) -> None:
    navigator, plant = begin()
    told = run(navigator, plant, Goal(8.5, 6.5), 60)
    assert told[0].remaining_distance == pytest.approx(8.0, abs=1.0)
    left = np.array([p.remaining_distance for p in told])
    assert (np.diff(left) < 0.06).all()
    for progress in told[:-1:20]:
        path = progress.path
        assert path.shape[1] == 3
        length = np.hypot(*np.diff(path[:, :2], axis=0).T).sum()
        assert progress.remaining_distance == pytest.approx(length, abs=0.15)


def test_commands_keep_velocity_and_acceleration_limits(begin) -> None:
    walker = Walker(np.array([(7.0, 1.0), (7.0, 7.0)]), 1.0, polite=True)
    navigator, plant = begin(walkers=(walker,), crates=(box(3.0, 4.0, 0.5, 0.5),))
    run(navigator, plant, Goal(8.5, 6.5, 3.0), 90)
    commands = [STANDSTILL, *(command for _, command in plant.commands)]
    for now, then in itertools.pairwise(commands):
        check_step(now, then, TICK / 1e9)
    assert max(c.linear for c in commands) > 0.9


def test_slow_region_is_driven_slowly(begin) -> None:
    ring = [[3, 0], [6, 0], [6, 8], [3, 8]]
    navigator, plant = begin(Hall(10, 8, overlays=[feature("Polygon", [ring], regionType=2)]))
    navigator.start(Goal(8.5, 4.0), plant.observe())
    fastest = {True: 0.0, False: 0.0}
    for _ in range(1000):
        progress = navigator.tick(plant.observe())
        inside = 3.4 < plant.pose[0] < 6.0
        fastest[inside] = max(fastest[inside], plant.v)
        plant.drive(progress.twist)
        if progress.arrived:
            break
    assert fastest[True] < 0.45 and fastest[False] > 0.8


def test_turn_only_stays_where_it_is(begin) -> None:
    navigator, plant = begin()
    before = plant.pose.copy()
    run(navigator, plant, Goal(yaw=2.5), 20)
    assert abs(wrap(plant.pose[2] - 2.5)) < math.radians(1.5)
    assert math.hypot(*(plant.pose - before)[:2]) < 0.01
    assert all(command.linear == 0.0 for _, command in plant.commands)


def test_zone_ends_as_soon_as_it_is_reached_without_stopping(begin) -> None:
    navigator, plant = begin()
    goal = Goal(8.5, 6.5, 1.0, accuracy=0.8, zone=True)
    run(navigator, plant, goal, 60)
    assert 0.7 < away(plant, goal)[0] < 0.85
    assert plant.v > 0.5


def test_a_wide_accuracy_without_zone_still_goes_to_the_point(begin) -> None:
    navigator, plant = begin()
    goal = Goal(3.5, 4.0, accuracy=0.5)
    run(navigator, plant, goal, 60)
    assert away(plant, goal)[0] < 0.05


def test_rotate_in_place_turns_only_at_standstill(begin) -> None:
    navigator, plant = begin()
    run(navigator, plant, Goal(8.5, 4.0, -1.0, rotate_in_place=True), 60)
    turning = [c for _, c in plant.commands if abs(c.angular) > 0.15]
    assert len(turning) > 40 and all(abs(c.linear) < 1e-9 for c in turning)


def test_without_rotate_in_place_bends_are_driven(begin) -> None:
    navigator, plant = begin()
    run(navigator, plant, Goal(8.5, 4.0), 60)
    assert any(c.linear > 0.4 and abs(c.angular) > 0.15 for _, c in plant.commands)


def test_goes_round_an_unmapped_crate_and_says_so(begin) -> None:
    navigator, plant = begin(Hall(10, 8))
    navigator.start(Goal(8.5, 4.0), plant.observe())
    plant.crates = [box(5.0, 4.0, 0.6, 0.6, 0.4)]
    told = keep_on(navigator, plant, 60)
    assert any(p.replanned for p in told) and plant.contacts == []


def test_stops_for_a_person_who_steps_in_front_and_goes_on(begin) -> None:
    alley = Hall(10, 8, [box(5, 1.7, 6, 3.2), box(5, 6.3, 6, 3.2)])
    walker = Walker(np.array([(9.0, 4.0), (5.0, 4.0)]), 1.0, polite=True)
    navigator, plant = begin(alley, walkers=(walker,))
    navigator.start(Goal(9.0, 4.0), plant.observe())
    stood = False
    for _ in range(1500):
        progress = navigator.tick(plant.observe())
        plant.drive(progress.twist)
        if not stood and plant.seconds > 12:
            stood = abs(plant.v) < 0.05 and plant.pose[0] < 5.0
            walker.points = np.array([(9.0, 1.0), (9.2, 1.0)])
            walker.position = np.array([9.2, 1.0])
        if progress.arrived:
            break
    assert stood and progress.arrived and plant.contacts == []


def walks_at_the_robot() -> Walker:
    """Somebody who comes along the robot's line, heeds nothing, and comes back 20 s later."""
    return Walker(np.array([(8.5, 4.0), (0.5, 4.0), (0.5, 7.5), (8.5, 7.5)]), 1.0)


def test_makes_way_for_a_person_who_does_not(begin) -> None:
    navigator, plant = begin(Hall(10, 8), walkers=(walks_at_the_robot(),))
    goal = Goal(8.5, 4.0, 0.0)
    run(navigator, plant, goal, 40)
    assert plant.contacts == [] and away(plant, goal)[0] < 0.05


def test_two_runs_are_the_same(begin) -> None:
    runs = []
    for _ in range(2):
        navigator, plant = begin(Hall(10, 8), walkers=(walks_at_the_robot(),))
        run(navigator, plant, Goal(8.5, 4.0, 0.0), 40)
        runs.append([(stamp, c.linear, c.angular) for stamp, c in plant.commands])
    assert runs[0] == runs[1]


def test_move_timeout_when_wheels_are_blocked(begin) -> None:
    navigator, plant = begin(settings=NavigationSettings(move_timeout=5.0, stuck_after=2.0))
    navigator.start(Goal(8.5, 4.0), plant.observe())
    plant.wheels_blocked = True
    states = []
    with pytest.raises(MoveFailed) as failed:
        while True:
            progress = navigator.tick(plant.observe())
            states.append(progress.stuck_state)
            plant.drive(progress.twist)
    assert failed.value.reason is Reason.MOVE_TIMEOUT
    assert states[0] == "none" and states[-1] == "move_stucked"


def test_rotate_timeout_when_wheels_are_blocked_at_the_goal(begin) -> None:
    navigator, plant = begin(settings=NavigationSettings(rotate_timeout=5.0, stuck_after=2.0))
    navigator.start(Goal(yaw=2.0), plant.observe())
    plant.wheels_blocked = True
    states = []
    with pytest.raises(MoveFailed) as failed:
        while True:
            progress = navigator.tick(plant.observe())
            states.append(progress.stuck_state)
            plant.drive(progress.twist)
    assert failed.value.reason is Reason.ROTATE_TIMEOUT
    assert states[-1] == "target_spin_stucked"


def test_rotate_timeout_when_something_stands_too_near_to_turn(begin) -> None:
    crates = (box(1.5, 4.42, 0.6, 0.3), box(1.5, 3.58, 0.6, 0.3))
    navigator, plant = begin(settings=NavigationSettings(rotate_timeout=4.0), crates=crates)
    navigator.start(Goal(yaw=1.57), plant.observe())
    assert "in the way" in fails(navigator, plant, Reason.ROTATE_TIMEOUT)
    assert plant.contacts == []


def test_planning_timeout_when_the_way_gets_sealed(begin) -> None:
    alley = Hall(10, 8, [box(5, 1.7, 6, 3.2), box(5, 6.3, 6, 3.2)])
    navigator, plant = begin(alley, settings=NavigationSettings(planning_timeout=10.0, move_timeout=20.0))
    navigator.start(Goal(9.0, 4.0), plant.observe())
    plant.crates = [box(7.5, 4.0, 0.5, 1.2)]
    blocked = []
    with pytest.raises(MoveFailed) as failed:
        for _ in range(1000):
            progress = navigator.tick(plant.observe())
            blocked.append(progress.viewport_blocked)
            plant.drive(progress.twist)
    assert failed.value.reason is Reason.PLANNING_TIMEOUT
    assert blocked[-1] and plant.contacts == [] and abs(plant.v) < 0.01


@pytest.mark.parametrize("fault", ["lidar_dead", "lidar_blind"])
def test_costmap_error_without_a_usable_scan(begin, fault: str) -> None:
    navigator, plant = begin()
    navigator.start(Goal(8.5, 6.5), plant.observe())
    for _ in range(75):
        plant.drive(navigator.tick(plant.observe()).twist)
    assert plant.v > 0.5
    setattr(plant, fault, True)
    began, stopped = plant.seconds, None
    with pytest.raises(MoveFailed) as failed:
        while True:
            plant.drive(navigator.tick(plant.observe()).twist)
            if stopped is None and plant.v < 0.02:
                stopped = plant.seconds - began
    assert failed.value.reason is Reason.CONTROL_COSTMAP_ERROR
    assert stopped is not None and stopped < (2.2 if fault == "lidar_dead" else 1.2)
    assert plant.seconds - began == pytest.approx(6.0, abs=0.3)


def test_goes_on_when_the_scan_comes_back(begin) -> None:
    navigator, plant = begin()
    navigator.start(Goal(8.5, 6.5), plant.observe())
    plant.lidar_dead = True
    for _ in range(75):
        plant.drive(navigator.tick(plant.observe()).twist)
    assert plant.v < 0.02
    plant.lidar_dead = False
    keep_on(navigator, plant, 60)


def test_brakes_without_a_pose_and_goes_on_with_one(begin) -> None:
    navigator, plant = begin()
    navigator.start(Goal(8.5, 6.5), plant.observe())
    for _ in range(75):
        plant.drive(navigator.tick(plant.observe()).twist)
    plant.pose_lost = True
    for _ in range(35):
        plant.drive(navigator.tick(plant.observe()).twist)
    assert plant.v < 0.02
    plant.pose_lost = False
    keep_on(navigator, plant, 60)


def test_move_timeout_when_the_pose_stays_out(begin) -> None:
    navigator, plant = begin(settings=NavigationSettings(move_timeout=4.0))
    navigator.start(Goal(8.5, 6.5), plant.observe())
    plant.pose_lost = True
    assert "pose" in fails(navigator, plant, Reason.MOVE_TIMEOUT)


def test_brake_comes_to_rest_within_the_limits(begin) -> None:
    navigator, plant = begin()
    navigator.start(Goal(8.5, 6.5), plant.observe())
    for _ in range(75):
        plant.drive(navigator.tick(plant.observe()).twist)
    now = plant.commands[-1][1]
    for _ in range(40):
        then = navigator.brake(plant.observe())
        check_step(now, then, TICK / 1e9)
        plant.drive(then)
        now = then
    assert now == Twist2(linear=0.0, angular=0.0) and plant.v < 0.02


def test_a_replaced_goal_begins_from_the_present_speed(begin) -> None:
    navigator, plant = begin()
    navigator.start(Goal(8.5, 6.5), plant.observe())
    for _ in range(75):
        plant.drive(navigator.tick(plant.observe()).twist)
    before = plant.commands[-1][1]
    run(navigator, plant, Goal(8.5, 1.5), 60)
    after = plant.commands[75 + 10][1]
    check_step(before, after, TICK / 1e9)


def test_warm_up_leaves_no_trace() -> None:
    navigator = ChassisNavigator()
    navigator.warm_up()
    with pytest.raises(RuntimeError, match="without a move"):
        navigator.tick(Plant(Hall(10, 8), (1.5, 4.0, 0.0)).observe())
