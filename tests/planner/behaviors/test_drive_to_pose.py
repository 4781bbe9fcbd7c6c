"""Whole moves on the plant: arrival, limits, people, faults and the reasons to give up."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from rackhand.schemas.base import Twist2
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import STANDSTILL, wrap
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.control.test_braking_guard import check_step
from tests.planner.map.test_grid import feature
from tests.planner.plant import TICK, Hall, Plant, Robot, Walker, box, idle, keep_on, run


def away(plant: Plant, goal: Goal) -> tuple[float, float]:
    yaw = 0.0 if goal.yaw is None else wrap(plant.pose[2] - goal.yaw)
    return math.hypot(plant.pose[0] - (goal.x or 0.0), plant.pose[1] - (goal.y or 0.0)), abs(yaw)


def fails(robot: Robot, plant: Plant, reason: Reason, seconds: float = 30) -> str:
    with pytest.raises(MoveFailed) as failed:
        keep_on(robot, plant, seconds)
    assert failed.value.reason is reason, failed.value.text
    return failed.value.text


def plan_first(robot: Robot) -> None:
    """Tick until the first path is there."""
    for _ in range(2):
        told = robot.tick()
        robot.plant.drive(told.twist)
    assert len(told.path)


@pytest.mark.parametrize("seed", range(3))
def test_arrives_within_5_cm_and_2_degrees_of_the_true_pose(begin, seed: int) -> None:
    robot, plant = begin(seed=seed)
    for goal in (Goal(8.5, 6.5, 2.0), Goal(8.5, 1.2, -1.0), Goal(8.3, 1.2, -1.0)):
        told = run(robot, plant, goal, 60)
        distance, yaw = away(plant, goal)
        assert distance < 0.03 and yaw < math.radians(1.5)
        assert told[-1].remaining_distance == 0.0 and told[-1].stuck_state == "none"
    assert plant.contacts == []


@pytest.mark.parametrize("stale", [0.04, 0.4])
def test_another_run_of_the_driver_is_driven_as_if_it_were_the_first(begin, stale: float) -> None:
    """Also where its first stamps are those of the former run: what was measured then must not weigh in."""
    robot, plant = begin()
    first = run(robot, plant, Goal(3.0, 4.0), 30)
    other = Plant(plant.hall, (1.6, 4.1, 0.1), seed=2)
    robot.restart(other)
    idle(robot, other, stale)
    plant = Plant(plant.hall, (1.5, 4.0, 0.0), seed=1)
    robot.restart(plant)
    robot.motion.set_map(plant.hall.map())
    idle(robot, plant, 0.4)
    again = run(robot, plant, Goal(3.0, 4.0), 30)
    assert [progress.twist for progress in again] == [progress.twist for progress in first]


def test_remaining_distance_shrinks_with_the_path(begin) -> None:
    robot, plant = begin()
    told = run(robot, plant, Goal(8.5, 6.5), 60)
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
    robot, plant = begin(walkers=(walker,), crates=(box(3.0, 4.0, 0.5, 0.5),))
    run(robot, plant, Goal(8.5, 6.5, 3.0), 90)
    commands = [STANDSTILL, *(command for _, command in plant.commands)]
    for now, then in itertools.pairwise(commands):
        check_step(now, then, TICK / 1e9)
    assert max(c.linear for c in commands) > 0.9


def test_slow_region_is_driven_slowly(begin) -> None:
    ring = [[3, 0], [6, 0], [6, 8], [3, 8]]
    robot, plant = begin(Hall(10, 8, overlays=[feature("Polygon", [ring], regionType=2)]))
    robot.start(Goal(8.5, 4.0))
    fastest = {True: 0.0, False: 0.0}
    for _ in range(1000):
        progress = robot.tick()
        inside = 3.4 < plant.pose[0] < 6.0
        fastest[inside] = max(fastest[inside], plant.v)
        plant.drive(progress.twist)
        if progress.arrived:
            break
    assert fastest[True] < 0.45 and fastest[False] > 0.8


def test_turn_only_stays_where_it_is(begin) -> None:
    robot, plant = begin()
    before = plant.pose.copy()
    run(robot, plant, Goal(yaw=2.5), 20)
    assert abs(wrap(plant.pose[2] - 2.5)) < math.radians(1.5)
    assert math.hypot(*(plant.pose - before)[:2]) < 0.01
    assert all(command.linear == 0.0 for _, command in plant.commands)


def test_zone_ends_as_soon_as_it_is_reached_without_stopping(begin) -> None:
    robot, plant = begin()
    goal = Goal(8.5, 6.5, 1.0, accuracy=0.8, zone=True)
    run(robot, plant, goal, 60)
    assert 0.7 < away(plant, goal)[0] < 0.85
    assert plant.v > 0.5


def test_a_wide_accuracy_without_zone_still_goes_to_the_point(begin) -> None:
    robot, plant = begin()
    goal = Goal(3.5, 4.0, accuracy=0.5)
    run(robot, plant, goal, 60)
    assert away(plant, goal)[0] < 0.05


def test_rotate_in_place_turns_only_at_standstill(begin) -> None:
    robot, plant = begin()
    run(robot, plant, Goal(8.5, 4.0, -1.0, rotate_in_place=True), 60)
    turning = [c for _, c in plant.commands if abs(c.angular) > 0.15]
    assert len(turning) > 40 and all(abs(c.linear) < 1e-9 for c in turning)


def test_without_rotate_in_place_bends_are_driven(begin) -> None:
    robot, plant = begin()
    run(robot, plant, Goal(8.5, 4.0), 60)
    assert any(c.linear > 0.4 and abs(c.angular) > 0.15 for _, c in plant.commands)


def test_goes_round_an_unmapped_crate_and_says_so(begin) -> None:
    robot, plant = begin(Hall(10, 8))
    robot.start(Goal(8.5, 4.0))
    plan_first(robot)
    plant.crates = [box(5.0, 4.0, 0.6, 0.6, 0.4)]
    told = keep_on(robot, plant, 60)
    assert any(p.replanned for p in told) and plant.contacts == []


def test_stops_for_a_person_who_steps_in_front_and_goes_on(begin) -> None:
    alley = Hall(10, 8, [box(5, 1.7, 6, 3.2), box(5, 6.3, 6, 3.2)])
    walker = Walker(np.array([(9.0, 4.0), (5.0, 4.0)]), 1.0, polite=True)
    robot, plant = begin(alley, walkers=(walker,))
    robot.start(Goal(9.0, 4.0))
    stood = False
    for _ in range(1500):
        progress = robot.tick()
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
    robot, plant = begin(Hall(10, 8), walkers=(walks_at_the_robot(),))
    goal = Goal(8.5, 4.0, 0.0)
    run(robot, plant, goal, 40)
    assert plant.contacts == [] and away(plant, goal)[0] < 0.05


def test_two_runs_are_the_same(begin) -> None:
    runs = []
    for _ in range(2):
        robot, plant = begin(Hall(10, 8), walkers=(walks_at_the_robot(),))
        run(robot, plant, Goal(8.5, 4.0, 0.0), 40)
        runs.append([(stamp, c.linear, c.angular) for stamp, c in plant.commands])
    assert runs[0] == runs[1]


def test_move_timeout_when_wheels_are_blocked(begin) -> None:
    robot, plant = begin(settings=NavigationSettings(move_timeout=5.0, stuck_after=2.0))
    robot.start(Goal(8.5, 4.0))
    plant.wheels_blocked = True
    states = []
    with pytest.raises(MoveFailed) as failed:
        while True:
            progress = robot.tick()
            states.append(progress.stuck_state)
            plant.drive(progress.twist)
    assert failed.value.reason is Reason.MOVE_TIMEOUT
    assert states[0] == "none" and states[-1] == "move_stucked"


def test_rotate_timeout_when_wheels_are_blocked_at_the_goal(begin) -> None:
    robot, plant = begin(settings=NavigationSettings(rotate_timeout=5.0, stuck_after=2.0))
    robot.start(Goal(yaw=2.0))
    plant.wheels_blocked = True
    states = []
    with pytest.raises(MoveFailed) as failed:
        while True:
            progress = robot.tick()
            states.append(progress.stuck_state)
            plant.drive(progress.twist)
    assert failed.value.reason is Reason.ROTATE_TIMEOUT
    assert states[-1] == "target_spin_stucked"


def test_rotate_timeout_when_an_obstacle_is_too_near_to_turn(begin) -> None:
    crates = (box(1.5, 4.42, 0.6, 0.3), box(1.5, 3.58, 0.6, 0.3))
    robot, plant = begin(settings=NavigationSettings(rotate_timeout=4.0), crates=crates)
    robot.start(Goal(yaw=1.57))
    assert "blocked by an obstacle" in fails(robot, plant, Reason.ROTATE_TIMEOUT)
    assert plant.contacts == []


def test_planning_timeout_when_the_way_gets_sealed(begin) -> None:
    alley = Hall(10, 8, [box(5, 1.7, 6, 3.2), box(5, 6.3, 6, 3.2)])
    robot, plant = begin(alley, settings=NavigationSettings(planning_timeout=10.0, move_timeout=20.0))
    robot.start(Goal(9.0, 4.0))
    plan_first(robot)
    plant.crates = [box(7.5, 4.0, 0.5, 1.2)]
    blocked = []
    with pytest.raises(MoveFailed) as failed:
        for _ in range(1000):
            progress = robot.tick()
            blocked.append(progress.viewport_blocked)
            plant.drive(progress.twist)
    assert failed.value.reason is Reason.PLANNING_TIMEOUT
    assert blocked[-1] and plant.contacts == [] and abs(plant.v) < 0.01


@pytest.mark.parametrize("fault", ["lidar_dead", "lidar_blind"])
def test_costmap_error_without_a_usable_scan(begin, fault: str) -> None:
    robot, plant = begin()
    robot.start(Goal(8.5, 6.5))
    for _ in range(75):
        plant.drive(robot.tick().twist)
    assert plant.v > 0.5
    setattr(plant, fault, True)
    began, stopped = plant.seconds, None
    with pytest.raises(MoveFailed) as failed:
        while True:
            plant.drive(robot.tick().twist)
            if stopped is None and plant.v < 0.02:
                stopped = plant.seconds - began
    assert failed.value.reason is Reason.CONTROL_COSTMAP_ERROR
    assert stopped is not None and stopped < (2.2 if fault == "lidar_dead" else 1.2)
    assert plant.seconds - began == pytest.approx(6.0, abs=0.3)


def test_goes_on_when_the_scan_comes_back(begin) -> None:
    robot, plant = begin()
    robot.start(Goal(8.5, 6.5))
    plant.lidar_dead = True
    for _ in range(75):
        plant.drive(robot.tick().twist)
    assert plant.v < 0.02
    plant.lidar_dead = False
    keep_on(robot, plant, 60)


def test_brakes_without_a_pose_and_goes_on_with_one(begin) -> None:
    robot, plant = begin()
    robot.start(Goal(8.5, 6.5))
    for _ in range(75):
        plant.drive(robot.tick().twist)
    plant.pose_lost = True
    for _ in range(35):
        plant.drive(robot.tick().twist)
    assert plant.v < 0.02
    plant.pose_lost = False
    keep_on(robot, plant, 60)


def test_brake_comes_to_rest_within_the_limits(begin) -> None:
    robot, plant = begin()
    robot.start(Goal(8.5, 6.5))
    for _ in range(75):
        plant.drive(robot.tick().twist)
    now = plant.commands[-1][1]
    for _ in range(40):
        then = robot.brake()
        check_step(now, then, TICK / 1e9)
        plant.drive(then)
        now = then
    assert now == Twist2(linear=0.0, angular=0.0) and plant.v < 0.02


def test_a_replaced_goal_begins_from_the_present_speed(begin) -> None:
    robot, plant = begin()
    robot.start(Goal(8.5, 6.5))
    for _ in range(75):
        plant.drive(robot.tick().twist)
    before = plant.commands[-1][1]
    run(robot, plant, Goal(8.5, 1.5), 60)
    after = plant.commands[75 + 10][1]
    check_step(before, after, TICK / 1e9)


def test_a_hold_resumes_the_stage_it_interrupted(begin) -> None:
    """Held while turning at the goal: it goes on turning, and does not plan or drive to the point again."""
    robot, plant = begin()
    robot.start(Goal(3.5, 4.0, 2.5))
    while not (abs(plant.w) > 0.5 and plant.pose[0] > 3.4):
        plant.drive(robot.tick().twist)
    for _ in range(100):
        plant.drive(robot.hold())
    assert abs(plant.w) < 0.01
    told = keep_on(robot, plant, 20)
    assert not any(progress.replanned or len(progress.path) for progress in told)
    assert away(plant, Goal(3.5, 4.0, 2.5))[1] < math.radians(1.5)


def test_a_hold_on_the_way_keeps_the_route(begin) -> None:
    robot, plant = begin()
    robot.start(Goal(8.5, 6.5))
    for _ in range(75):
        plant.drive(robot.tick().twist)
    for _ in range(2000):
        plant.drive(robot.hold())
    told = keep_on(robot, plant, 60)
    assert not told[0].replanned and len(told[0].path) and told[0].stuck_state == "none"
    assert plant.contacts == []


def test_a_chassis_that_was_pushed_during_a_hold_gets_a_route_from_where_it_is(begin) -> None:
    robot, plant = begin()
    robot.start(Goal(8.5, 6.5))
    for _ in range(75):
        plant.drive(robot.tick().twist)
    for _ in range(50):
        plant.drive(robot.hold())
    plant.pose += (0.0, -1.2, 0.4)
    for _ in range(50):
        plant.drive(robot.hold())
    told = keep_on(robot, plant, 60)
    assert any(progress.replanned for progress in told)
    assert away(plant, Goal(8.5, 6.5))[0] < 0.05 and plant.contacts == []


def test_held_on_the_goal_it_has_arrived(begin) -> None:
    robot, plant = begin()
    robot.start(Goal(3.5, 4.0))
    for _ in range(25):
        plant.drive(robot.tick().twist)
    for _ in range(50):
        plant.drive(robot.hold())
    plant.pose[:2] = 3.5, 4.0
    for _ in range(50):
        plant.drive(robot.hold())
    keep_on(robot, plant, 5)
