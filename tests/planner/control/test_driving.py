from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.schemas.base import Twist2
from rackhand.services.planner.control import driving
from rackhand.services.planner.control.route import Route
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from tests.planner.control.test_route import FOOTPRINT, S, costmap, route, segment
from tests.planner.map.test_grid import feature
from tests.planner.plant import Hall, box

STILL = Twist2(linear=0.0, angular=0.0)
DRIVING = Twist2(linear=0.5, angular=0.0)


def follow(
    path: Route, pose: tuple[float, float, float], twist: Twist2 = DRIVING, free: float = math.inf,
    around: LocalCostmap | None = None, in_place: bool = False,
) -> Twist2:  # fmt: skip
    here = np.array(pose)
    path.current.update(here)
    return driving.follow(path, here, twist, free, around or costmap(), FOOTPRINT, S, in_place)


def test_turns_to_the_first_heading_before_it_drives() -> None:
    path = route(segment(1, 7))
    assert follow(path, (1.0, 2.0, 1.5), STILL) == Twist2(linear=0.0, angular=driving.turn_rate(-1.5, 1.2))
    assert not path.current.aligned
    assert follow(path, (1.0, 2.0, 0.02), STILL).linear > 0.3
    assert path.current.aligned


def test_a_small_turn_is_driven_unless_it_is_to_be_in_place() -> None:
    assert follow(route(segment(1, 7)), (1.0, 2.0, 0.3), STILL).linear > 0.0
    assert follow(route(segment(1, 7)), (1.0, 2.0, 0.3), STILL, in_place=True).linear == 0.0


def test_steers_back_to_the_line() -> None:
    assert follow(route(segment(1, 7)), (2.0, 2.1, 0.0)).angular < 0.0
    assert follow(route(segment(1, 7)), (2.0, 1.9, 0.0)).angular > 0.0
    assert abs(follow(route(segment(1, 7)), (2.0, 1.7, 0.0), in_place=True).angular) <= driving.LINE_KEEPING_RATE


def test_backward_it_drives_backward_and_no_faster_than_that_limit() -> None:
    path = route(segment(4, 1))
    path.current.aligned = True
    command = follow(path, (3.0, 2.0, 0.0))
    assert command.linear == pytest.approx(S.control.max_backward_velocity)


def test_slows_for_what_blocks_the_path_and_stops_before_it() -> None:
    speeds = [follow(route(segment(1, 7)), (1.0, 2.0, 0.0), free=free).linear for free in (math.inf, 1.5, 0.8, 0.3)]
    assert speeds == sorted(speeds, reverse=True) and speeds[-1] == 0.0
    left = 1.5 - S.stop_before_obstacle
    assert speeds[1] ** 2 / (2 * S.approach_decel) <= left


def test_keeps_the_speed_of_a_slow_zone() -> None:
    from rackhand.services.planner.map.grid import load_map

    zone = feature("Polygon", [[[0, 0], [8, 0], [8, 4], [0, 4]]], regionType=2)
    slow = LocalCostmap(load_map(Hall(8, 4, overlays=[zone]).map(), 0.4), S)
    assert follow(route(segment(1, 7)), (1.0, 2.0, 0.0)).linear > 0.6
    assert follow(route(segment(1, 7)), (1.0, 2.0, 0.0), around=slow).linear == pytest.approx(0.4)


def test_turns_the_other_way_round_where_only_that_is_free() -> None:
    long_nose = Footprint.of(np.array([(0.6, 0.23), (-0.2, 0.23), (-0.2, -0.23), (0.6, -0.23)]))
    here = np.array([4.0, 2.0, 0.0])
    blocked = costmap(box(4.25, 2.43, 0.1, 0.1))  # where the nose comes on its turn to the left
    blocked.refresh(here)
    assert blocked.near.clearance(long_nose, here) > 0.0
    assert driving.turn(here, 2.6, blocked, long_nose, S).angular < 0.0
    assert driving.turn(here, 2.6, costmap(), long_nose, S).angular > 0.0


def test_an_end_is_reached_near_it_or_beside_it() -> None:
    path = route(segment(1, 4))
    for x in (2.0, 3.0, 4.0):
        path.current.update(np.array([x, 2.0, 0.0]))
    assert driving.has_ended(path, np.array([3.99, 2.0, 0.0]), 0.012)
    assert not driving.has_ended(path, np.array([3.9, 2.0, 0.0]), 0.012)
    beside = np.array([4.01, 2.1, 0.0])
    assert not driving.has_ended(path, beside, 0.012)
    path.current.aligned = True
    assert driving.has_ended(path, beside, 0.012)
