from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.planning.cost_to_go import cost_to_go
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.inflation import Inflation
from rackhand.services.planner.planning.shaping import chain, headings, line_cost, pull_tight, resample, smooth

INFLATION = Inflation(0.2, 0.3, 4.0)


def grid_with_block() -> DistanceGrid:
    """6 x 4 m with a block of 1 m in the middle."""
    blocked = np.zeros((40, 60), dtype=np.bool_)
    blocked[15:25, 25:35] = True
    return DistanceGrid.of(blocked, Geometry(0.0, 0.0, 0.1, 40, 60))


def length(points: np.ndarray) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def chain_around_block() -> tuple[DistanceGrid, np.ndarray]:
    grid = grid_with_block()
    _, toward, _ = cost_to_go(grid, 20, 50, INFLATION, 10**6)
    return grid, chain(toward, 20 * 60 + 10, grid.geometry)


def test_chain_goes_from_cell_to_cell_to_the_goal() -> None:
    _, points = chain_around_block()
    assert points[0] == pytest.approx([1.05, 2.05]) and points[-1] == pytest.approx([5.05, 2.05])
    assert np.hypot(*np.diff(points, axis=0).T).max() <= 0.1 * math.sqrt(2) + 1e-9


def test_line_cost_is_the_length_where_it_is_free_and_infinite_where_it_is_not() -> None:
    grid = grid_with_block()
    a, b = np.array([0.5, 0.5]), np.array([5.5, 0.5])
    assert line_cost(grid, INFLATION, a, b) == pytest.approx(5.0)
    assert line_cost(grid, INFLATION, np.array([0.5, 2.0]), np.array([5.5, 2.0])) == math.inf
    past = np.array([0.5, 1.25]), np.array([5.5, 1.25])
    assert 5.0 < line_cost(grid, INFLATION, *past) < 15.0


def test_pulled_tight_is_shorter_with_few_corners_and_free() -> None:
    grid, points = chain_around_block()
    corners = pull_tight(grid, INFLATION, points)
    assert len(corners) < len(points) / 2 and length(corners) <= length(points) + 1e-9
    assert corners[0] == pytest.approx(points[0]) and corners[-1] == pytest.approx(points[-1])
    for a, b in itertools.pairwise(corners):
        assert np.isfinite(line_cost(grid, INFLATION, a, b))


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=2, max_size=6), st.floats(0.05, 1.0))
def test_resampled_has_the_corners_and_no_gaps(corners: list[tuple[float, float]], spacing: float) -> None:
    given_points = np.array(corners)
    points = resample(given_points, spacing)
    assert np.hypot(*np.diff(points, axis=0).T).max() <= spacing * (1 + 1e-9)
    assert length(points) == pytest.approx(length(given_points))
    for corner in given_points:
        assert np.hypot(*(points - corner).T).min() < 1e-9


def test_smoothed_bends_less_keeps_its_ends_and_its_clearance() -> None:
    grid, chained = chain_around_block()
    points = resample(pull_tight(grid, INFLATION, chained), 0.05)
    smoothed = smooth(grid, points, 0.5, 60)
    assert np.array_equal(smoothed[[0, -1]], points[[0, -1]])

    def sharpest(path: np.ndarray) -> float:
        yaw = np.unwrap(headings(path)[:-1, 2])
        return float(np.abs(np.diff(yaw)).max())

    assert sharpest(smoothed) < 0.5 * sharpest(points)
    assert min(grid.at(x, y) for x, y in smoothed) >= min(grid.at(x, y) for x, y in points) - 1e-9


def test_headings_point_to_the_next_and_the_last_keeps_its_own() -> None:
    rows = headings(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 2.0)]))
    assert rows[:, 2] == pytest.approx([0.0, math.pi / 2, math.pi / 2])
    assert headings(np.array([(3.0, 4.0)])).tolist() == [[3.0, 4.0, 0.0]]
