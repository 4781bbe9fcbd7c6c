"""What is refused before anything is planned, in words."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.map.grid import load_map
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.planning.goals import RINGS, Goal, check_goal, check_start, zone_target
from rackhand.services.planner.planning.plan import Target
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import BODY, Hall, box

S = NavigationSettings()
FOOTPRINT = Footprint.of(BODY)


@pytest.fixture(scope="module")
def costmap() -> LocalCostmap:
    return LocalCostmap(load_map(Hall(10, 8, [box(5, 4, 1, 2)]).map(), S.slow_zone_velocity), S)


def start_refused(costmap: LocalCostmap, x: float, y: float, yaw: float) -> MoveFailed:
    with pytest.raises(MoveFailed) as failed:
        check_start(costmap, FOOTPRINT, np.array([x, y, yaw]))
    return failed.value


def goal_refused(costmap: LocalCostmap, target: Target) -> MoveFailed:
    with pytest.raises(MoveFailed) as failed:
        check_goal(costmap, FOOTPRINT, target, S)
    return failed.value


def test_start_outside_the_map(costmap: LocalCostmap) -> None:
    failed = start_refused(costmap, -1.0, 4.0, 0.0)
    assert failed.reason is MoveFailReason.STARTING_POINT_OUT_OF_MAP
    assert failed.text == "the chassis is at (-1.00, 4.00), outside the map (0.00, 0.00) to (10.00, 8.00)"


def test_start_overlaps_a_wall_by_more_than_noise(costmap: LocalCostmap) -> None:
    check_start(costmap, FOOTPRINT, np.array([4.5 - 0.375 + 0.02, 4.0, 0.0]))
    failed = start_refused(costmap, 4.5 - 0.375 + 0.10, 4.0, 0.0)
    assert failed.reason is MoveFailReason.STARTING_POINT_NOT_IN_GROUND
    assert "its footprint overlaps non-traversable cells by 0." in failed.text


def test_goal_outside_the_map(costmap: LocalCostmap) -> None:
    failed = goal_refused(costmap, Target(12.0, 4.0, None))
    assert failed.reason is MoveFailReason.ENDING_POINT_OUT_OF_MAP
    assert failed.text == "the goal is at (12.00, 4.00), outside the map (0.00, 0.00) to (10.00, 8.00)"


def test_goal_needs_the_inscribed_circle_and_with_a_heading_the_footprint(costmap: LocalCostmap) -> None:
    beside = Target(5.0, 5.0 + 0.3, None)
    check_goal(costmap, FOOTPRINT, beside, S)
    check_goal(costmap, FOOTPRINT, Target(beside.x, beside.y, 0.0), S)
    failed = goal_refused(costmap, Target(beside.x, beside.y, 1.57))
    assert failed.reason is MoveFailReason.ENDING_POINT_NOT_IN_GROUND
    text = "the goal is at (5.00, 5.30), the goal footprint overlaps non-traversable cells by 0.0"
    assert failed.text.startswith(text), failed.text
    failed = goal_refused(costmap, Target(5.0, 5.0 + 0.13, None))
    assert failed.text.endswith("by 0.10 m or more"), failed.text


def test_a_zone_is_aimed_at_in_its_middle_and_farther_out_where_that_is_asked_for(costmap: LocalCostmap) -> None:
    goal, pose = Goal(x=2.0, y=2.0, accuracy=0.8, zone=True), np.array([1.0, 2.0, 0.0])
    assert zone_target(costmap, FOOTPRINT, goal, pose) == Target(2.0, 2.0, None)
    for ring in (1, RINGS):
        target = zone_target(costmap, FOOTPRINT, goal, pose, ring)
        assert target is not None
        away = 0.95 * 0.8 * ring / RINGS
        assert (target.x, target.y) == pytest.approx((2.0 - away, 2.0)), "towards the chassis"
