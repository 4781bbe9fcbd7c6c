from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.schemas.base import Twist2
from rackhand.services.planner.control.goal_checker import LEAST_ACCURACY, PUSHED_ASIDE, GoalChecker, is_still
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.settings import NavigationSettings

S = NavigationSettings()
START = np.array([1.0, 2.0, 0.0])


def at(x: float, y: float = 2.0, yaw: float = 0.0) -> np.ndarray:
    return np.array([x, y, yaw])


def test_position_and_heading_by_the_accuracy_of_the_goal() -> None:
    checker = GoalChecker(Goal(4.0, 2.0, 3.1, accuracy=0.1), START, S)
    assert checker.distance(START) == pytest.approx(3.0)
    assert checker.has_position(at(3.93)) and not checker.has_position(at(3.9))
    assert checker.was_pushed_aside(at(4.0 - 0.1 - PUSHED_ASIDE - 0.01)) and not checker.was_pushed_aside(at(3.9))
    assert checker.heading_error(at(4.0, yaw=-3.1)) == pytest.approx(6.2 - 2 * math.pi)
    assert checker.has_heading(at(4.0, yaw=3.1)) and not checker.has_heading(at(4.0, yaw=3.0))
    exact = GoalChecker(Goal(4.0, 2.0, accuracy=0.001), START, S)
    assert exact.has_position(at(4.0 - 0.9 * LEAST_ACCURACY))


def test_any_heading() -> None:
    checker = GoalChecker(Goal(4.0, 2.0), START, S)
    assert checker.heading_error(at(4.0, yaw=2.0)) == 0.0 and checker.has_heading(at(4.0, yaw=2.0))
    assert checker.as_pose(at(1.0, yaw=2.0)).tolist() == [4.0, 2.0, 2.0]


def test_a_turn_keeps_its_place() -> None:
    checker = GoalChecker(Goal(yaw=1.0), START, S)
    assert checker.turn_only and (checker.target.x, checker.target.y) == (1.0, 2.0)
    assert checker.has_position(at(1.3)) and not checker.was_pushed_aside(at(1.3))


def test_a_zone_is_reached_within_its_accuracy_at_any_heading() -> None:
    zone, point = (GoalChecker(Goal(4.0, 2.0, 1.0, accuracy=0.5, zone=z), START, S) for z in (True, False))
    assert zone.is_in_zone(at(3.6)) and not zone.is_in_zone(at(3.4)) and not point.is_in_zone(at(4.0))
    assert zone.is_there(at(3.6)) and not point.is_there(at(3.6)) and point.is_there(at(3.6, yaw=1.0))


def test_standstill_but_for_noise() -> None:
    assert is_still(Twist2(linear=0.01, angular=-0.02))
    assert not is_still(Twist2(linear=-0.02, angular=0.0)) and not is_still(Twist2(linear=0.0, angular=0.04))


def test_a_goal_that_is_reached_before_the_start() -> None:
    here = np.array([1.0, 2.0, 0.1])
    assert GoalChecker(Goal(1.02, 2.0, 0.12), here, S).is_there(here)
    assert not GoalChecker(Goal(1.02, 2.0, 0.2), here, S).is_there(here)
    assert GoalChecker(Goal(1.02, 2.0, None), here, S).is_there(here)
    assert not GoalChecker(Goal(1.04, 2.0, None), here, S).is_there(here)
