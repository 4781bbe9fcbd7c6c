from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.services.planner.control.route import Route
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.map.grid import load_map
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.planning.plan import Plan, Segment
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import BODY, Hall, box

S = NavigationSettings()
FOOTPRINT = Footprint.of(BODY)


def segment(x0: float, x1: float, y: float = 2.0) -> Segment:
    x = np.linspace(x0, x1, round(abs(x1 - x0) / 0.05) + 1)
    return Segment(np.column_stack([x, np.full(len(x), y), np.zeros(len(x))]), x1 < x0)


def route(*segments: Segment) -> Route:
    return Route(Plan(segments, np.zeros((1, 1), dtype=np.float32)))


def costmap(*mapped: np.ndarray) -> LocalCostmap:
    found = LocalCostmap(load_map(Hall(8, 4, list(mapped)).map(), S.slow_zone_velocity), S)
    found.refresh(np.array([1.0, 2.0, 0.0]))
    return found


def test_segments_one_after_the_other() -> None:
    there_and_back = route(segment(1, 4), segment(4, 2))
    here = np.array([2.0, 2.0, 0.0])
    there_and_back.current.update(here)
    assert there_and_back.left(here) == pytest.approx(2.0 + 2.0, abs=0.06)
    assert there_and_back.ahead()[0, 0] == pytest.approx(2.0, abs=0.06)
    assert there_and_back.ahead()[-1, 0] == 2.0 and not there_and_back.is_last
    there_and_back.advance()
    assert there_and_back.is_last and there_and_back.current.segment.backward
    assert there_and_back.left(np.array([4.0, 2.0, 0.0])) == pytest.approx(2.0)
    assert there_and_back.ahead() == pytest.approx(segment(4, 2).points)


def test_what_is_ahead_is_not_copied_in_each_tick() -> None:
    long = route(segment(1, 4), segment(4, 700))
    assert np.shares_memory(long.ahead(), long.ahead())
    assert long.trackers[1].segment.length is long.trackers[1].segment.length


def test_free_distance_ends_where_the_body_would_touch() -> None:
    free, where = route(segment(1, 7)).free_distance(costmap(box(5.5, 2.0, 1.0, 0.4)), FOOTPRINT, 6.0)
    assert free == pytest.approx(5.0 - 0.375 - 1.0, abs=0.1)
    assert where == pytest.approx([1.0 + free, 2.0])


def test_free_distance_is_infinite_within_reach() -> None:
    blocked = costmap(box(5.5, 2.0, 1.0, 0.4))
    assert route(segment(1, 7)).free_distance(blocked, FOOTPRINT, 3.0)[0] == math.inf
    assert route(segment(1, 7)).free_distance(costmap(), FOOTPRINT, 4.5)[0] == math.inf
