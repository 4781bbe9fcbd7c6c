from __future__ import annotations

import numpy as np
import pytest

from rackhand.services.planner.control.dynamic_avoidance import HOLD, DynamicAvoidance, least_gap
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import BODY

S = NavigationSettings()
FOOTPRINT = Footprint.of(BODY)
HERE = np.zeros(3)
PATH = np.column_stack([np.arange(0.0, 6.0, 0.05), np.zeros(120), np.zeros(120)])


def obstacle(*row: float) -> np.ndarray:
    return np.array([row])


def gap(speed: float, row: np.ndarray) -> float:
    return least_gap(HERE, PATH, speed, row, FOOTPRINT.edges, 3.0)


def test_gap_to_something_at_rest() -> None:
    assert gap(0.0, obstacle(2.0, 0.0, 0.0, 0.0, 0.3)) == pytest.approx(2.0 - 0.375 - 0.3)
    assert gap(0.5, obstacle(2.0, 0.0, 0.0, 0.0, 0.3)) == pytest.approx(2.0 - 1.5 - 0.375 - 0.3, abs=0.11)


def test_gap_to_something_that_comes_and_to_something_that_leaves() -> None:
    assert gap(0.0, obstacle(4.0, 0.0, -1.0, 0.0, 0.3)) == pytest.approx(1.0 - 0.375 - 0.3)
    assert gap(0.0, obstacle(1.0, 0.0, 1.0, 0.0, 0.3)) == pytest.approx(1.0 - 0.375 - 0.3)
    assert gap(0.0, obstacle(0.0, 3.0, 0.0, -1.0, 0.2)) < 0.0


def due(row: np.ndarray, avoidance: DynamicAvoidance | None = None, stamp: int = 0) -> bool:
    return (avoidance or DynamicAvoidance(S)).is_due(HERE, PATH, 0.8, row, FOOTPRINT, stamp)


def test_due_if_it_comes_near_a_chassis_that_stops_or_goes_on() -> None:
    assert due(obstacle(3.0, 0.0, -1.0, 0.0, 0.3))
    assert due(obstacle(2.4, 3.0, 0.0, -1.0, 0.3))  # only where the chassis will be
    assert not due(obstacle(0.0, 4.0, 0.0, 1.0, 0.3))
    assert not due(np.empty((0, 5)))


def test_holds_on_for_a_moment_and_a_new_move_begins_without() -> None:
    avoidance, near, away = DynamicAvoidance(S), obstacle(1.5, 0.0, -1.0, 0.0, 0.3), obstacle(0.0, 9.0, 0.0, 1.0, 0.3)
    assert due(near, avoidance)
    assert due(away, avoidance, int((HOLD - 0.05) * 1e9))
    assert not due(away, avoidance, int((HOLD + 0.05) * 1e9))
    assert due(near, avoidance, 10**9)
    avoidance.begin()
    assert not due(away, avoidance, 10**9)
