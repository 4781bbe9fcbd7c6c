from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.planning.cost_to_go import cost_to_go
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.inflation import Inflation


def test_cost_to_go_goes_round_a_wall_and_ends_at_the_budget() -> None:
    blocked = np.zeros((60, 60), dtype=np.bool_)
    blocked[:45, 30] = True
    grid = DistanceGrid.of(blocked, Geometry(0.0, 0.0, 0.1, 60, 60))
    inflation = Inflation(0.2, 0.3, 0.0)
    cost, toward, expanded = cost_to_go(grid, 10, 50, inflation, 10**6)
    over = math.hypot(2.0, 3.7) + math.hypot(2.0, 3.7)
    assert cost[10, 10] == pytest.approx(over, rel=0.1)
    assert np.isinf(cost[10, 30])
    index, steps = 10 * 60 + 10, 0
    while toward[index] >= 0:
        index, steps = toward[index], steps + 1
    assert index == 10 * 60 + 50 and steps < 200
    assert cost_to_go(grid, 10, 50, inflation, 100)[2] == 100 < expanded


def test_a_metre_along_a_wall_costs_more() -> None:
    blocked = np.zeros((40, 60), dtype=np.bool_)
    blocked[0] = True
    grid = DistanceGrid.of(blocked, Geometry(0.0, 0.0, 0.1, 40, 60))
    plain, _, _ = cost_to_go(grid, 4, 50, Inflation(0.2, 0.5, 0.0), 10**6)
    inflated, toward, _ = cost_to_go(grid, 4, 50, Inflation(0.2, 0.5, 4.0), 10**6)
    assert plain[4, 10] == pytest.approx(4.0)
    assert inflated[4, 10] > plain[4, 10] + 0.3
    rows, index = [], 4 * 60 + 10
    while toward[index] >= 0:
        index = toward[index]
        rows.append(index // 60)
    assert max(rows) > 5  # away from the wall and back


def test_no_path_where_the_inscribed_circle_does_not_fit() -> None:
    blocked = np.zeros((40, 60), dtype=np.bool_)
    blocked[:, 30] = True
    blocked[18:22, 30] = False  # a gap of 0.4 m
    grid = DistanceGrid.of(blocked, Geometry(0.0, 0.0, 0.1, 40, 60))
    assert np.isfinite(cost_to_go(grid, 20, 50, Inflation(0.14, 0.5, 1.0), 10**6)[0][20, 10])
    assert np.isinf(cost_to_go(grid, 20, 50, Inflation(0.25, 0.5, 1.0), 10**6)[0][20, 10])


def test_each_cell_is_expanded_once_however_far_it_is() -> None:
    """Costs are stored as float32, whose steps are 0.00006 m at 1000 m."""
    side = 200
    blocked = np.zeros((side, side), dtype=np.bool_)
    blocked[::20, ::20] = True
    grid = DistanceGrid.of(blocked, Geometry(0.0, 0.0, 5.03, side, side))
    cost, _, expanded = cost_to_go(grid, 1, 1, Inflation(2.0, 9.0, 1.7), 10 * side * side)
    assert np.isfinite(cost).sum() == expanded <= side * side
    assert cost[np.isfinite(cost)].max() > 1000.0
