from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.planning import lattice
from rackhand.services.planner.planning.cost_to_go import cost_to_go
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.inflation import Inflation
from rackhand.services.planner.planning.lattice import Ends, Margins, Problem, Search, needed, rest_is_free
from tests.planner.plant import BODY

FOOTPRINT = Footprint.of(BODY)
MARGINS = Margins(0.035, 0.035, 0.035)
INFLATION = Inflation(FOOTPRINT.inscribed, 0.5, 4.0)


def corridor(width: float, closed_at: float = math.inf) -> DistanceGrid:
    """6 x 4 m, free along y = 2 only; the body turns in it from 0.9 m on."""
    y = (np.arange(80) + 0.5) * 0.05
    blocked = np.repeat((np.abs(y - 2.0) > width / 2)[:, None], 120, axis=1)
    if math.isfinite(closed_at):
        blocked[:, round(closed_at / 0.05) :] = True
    return DistanceGrid.of(blocked, Geometry(0.0, 0.0, 0.05, 80, 120))


def ends(start: tuple[float, float, float], goal: tuple[float, float, float], any_yaw: bool = False) -> Ends:
    return Ends(np.array(start, dtype=np.float64), np.array(goal, dtype=np.float64), any_yaw, MARGINS)


def search(grid: DistanceGrid, between: Ends, budget: int = 100_000) -> Search:
    row, column = grid.geometry.cell(between.goal[0], between.goal[1])
    cost, _, _ = cost_to_go(grid, row, column, INFLATION, 10**6)
    return Search(Problem(grid, cost, FOOTPRINT, INFLATION, between, 1.3), budget)


def test_clearance_asked_for_is_less_near_ends_that_have_less() -> None:
    near = Ends(np.zeros(3), np.array([9.0, 0.0, 0.0]), False, Margins(0.05, 0.01, 0.02))
    assert needed(0.0, 0.0, near) == pytest.approx(0.01)
    assert needed(0.2, 0.0, near) == pytest.approx(0.01 + 0.2 * lattice.RELAXED_SLOPE)
    assert needed(5.0, 0.0, near) == pytest.approx(0.05)
    assert needed(9.0, 0.0, near) == pytest.approx(0.02)


def test_the_rest_is_free_forward_where_no_turn_is_needed() -> None:
    grid = corridor(0.7)
    assert rest_is_free(grid, FOOTPRINT, np.array([1.0, 2.0, 0.0]), ends((1, 2, 0), (4, 2, 0)), 1.0)
    assert not rest_is_free(grid, FOOTPRINT, np.array([1.0, 2.0, 0.0]), ends((1, 2, 0), (4, 2, 1.5)), 1.0)
    assert rest_is_free(grid, FOOTPRINT, np.array([1.0, 2.0, 0.0]), ends((1, 2, 0), (4, 2, 1.5), True), 1.0)


def test_the_rest_is_free_backward_where_the_goal_is_behind() -> None:
    grid, behind = corridor(0.7), ends((4, 2, 0), (1, 2, 0))
    assert rest_is_free(grid, FOOTPRINT, np.array([4.0, 2.0, 0.0]), behind, -1.0)
    assert not rest_is_free(grid, FOOTPRINT, np.array([4.0, 2.0, 0.0]), behind, 1.0)


def test_a_path_backward_out_of_a_corridor_is_found_in_slices() -> None:
    whole = search(corridor(0.7), ends((4, 2, 0), (1, 2, 0)))
    assert whole.run(100_000) == lattice.FOUND
    rows, direction = whole.path()
    assert (rows[1:, 3] == -1).all() and direction == -1.0
    assert np.abs(rows[:, 1] - 2.0).max() < 0.1 and np.abs(rows[:, 2]).max() < 0.2
    sliced = search(corridor(0.7), ends((4, 2, 0), (1, 2, 0)))
    slices = 1
    while sliced.run(3) == lattice.RUNNING:
        slices += 1
    assert slices > 1 and sliced.expanded == whole.expanded
    assert np.array_equal(sliced.path()[0], rows)


def test_all_states_are_free() -> None:
    grid = corridor(1.1)
    found = search(grid, ends((1, 2, 0), (4, 2, 3.1)))
    assert found.run(100_000) == lattice.FOUND
    for x, y, yaw, _ in found.path()[0]:
        assert grid.clearance(FOOTPRINT, np.array([x, y, yaw])) >= MARGINS.general - 0.01


def test_no_path_for_the_body_is_exhausted_and_a_budget_cuts_short() -> None:
    turned = ends((1, 2, 0), (4, 2, 1.5))
    assert search(corridor(0.7), turned).run(10**6) == lattice.EXHAUSTED
    assert search(corridor(0.7), turned, budget=20).run(10**6) == lattice.CUT_SHORT


def box(inner: float, gap: float = 0.0) -> DistanceGrid:
    """8 x 4 m with a square of walls around (6, 2), ``inner`` metres wide inside; ``gap``: of its side to the west."""
    blocked = np.zeros((80, 160), dtype=bool)
    x, y = (np.arange(160) + 0.5) * 0.05, (np.arange(80) + 0.5) * 0.05
    away = np.maximum(np.abs(x[None, :] - 6.0), np.abs(y[:, None] - 2.0))
    blocked[(away > inner / 2) & (away < inner / 2 + 0.1)] = True
    blocked[(np.abs(y[:, None] - 2.0) < gap / 2) & (x[None, :] < 6.0)] = False
    return DistanceGrid.of(blocked, Geometry(0.0, 0.0, 0.05, 80, 160))


@pytest.mark.parametrize("any_yaw", [True, False])
def test_a_goal_in_a_box_is_sealed_and_with_a_gap_it_is_not(any_yaw: bool) -> None:
    between = ends((1.0, 2.0, 0.0), (6.0, 2.0, 0.0), any_yaw)
    for grid, sealed in ((box(1.0), True), (box(1.0, gap=0.7), False), (box(3.0), False)):  # the last is no pocket
        problem = Problem(grid, np.zeros(grid.distance.shape, dtype=np.float32), FOOTPRINT, INFLATION, between, 1.3)
        assert lattice.is_sealed(problem) is sealed


def test_a_box_that_the_footprint_does_not_fit_into_is_sealed() -> None:
    grid, between = box(0.5), ends((1.0, 2.0, 0.0), (6.0, 2.0, 0.0), True)
    problem = Problem(grid, np.zeros(grid.distance.shape, dtype=np.float32), FOOTPRINT, INFLATION, between, 1.3)
    assert lattice.is_sealed(problem)
