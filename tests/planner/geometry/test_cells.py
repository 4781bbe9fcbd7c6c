from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.services.planner.geometry.cells import FAR_CELL, Geometry, cells_in, cells_near

GRID = Geometry(-3.0, 2.0, 0.05, 40, 60)


@given(st.integers(0, 39), st.integers(0, 59))
def test_the_cell_of_a_centre_is_that_cell(row: int, column: int) -> None:
    assert GRID.cell(*GRID.centre(row, column)) == (row, column)
    assert GRID.contains(*GRID.centre(row, column))


def test_outside_is_not_contained_but_has_a_cell_number() -> None:
    assert GRID.cell(-3.01, 4.01) == (40, -1)
    for x, y in ((-3.01, 3.0), (0.01, 3.0), (-1.0, 1.99), (-1.0, 4.01)):
        assert not GRID.contains(x, y)


@pytest.mark.parametrize("far", [1e9, 1e300, 1.7e308])
def test_points_at_the_ends_of_a_float_are_outside(far: float) -> None:
    grid = Geometry(-5.0, -5.0, 0.05, 200, 200)
    for x, y in ((far, 0.0), (-far, 0.0), (0.0, far), (0.0, -far), (far, -far)):
        assert not grid.contains(x, y)
        assert all(abs(index) <= FAR_CELL for index in grid.cell(x, y))


def test_cells_in_a_polygon_and_near_a_point_are_those_whose_centres_are() -> None:
    g = Geometry(-1.0, 2.0, 0.1, 20, 30)
    square = np.array([(-0.5, 2.5), (-0.1, 2.5), (-0.1, 2.9), (-0.5, 2.9)])
    cells = cells_in(g, square)
    centres = g.centres(cells)
    assert len(cells) == 16 and (np.abs(centres - (-0.3, 2.7)) < 0.2).all()
    assert [g.cell(*centre) for centre in centres] == [divmod(cell, g.columns) for cell in cells.tolist()]
    assert len(cells_near(g, np.array([-0.3, 2.7]), 0.1)) == 4
    assert len(cells_in(g, square - (0.7, 0.0))) == 8, "cells beyond the edge of the grid are left out"


def test_a_window_holds_the_cells_between_two_corners_and_is_empty_beside_the_grid() -> None:
    rows, columns = GRID.window((-2.98, 2.02), (-2.88, 2.07))
    assert (rows, columns) == (slice(0, 2), slice(0, 3))
    rows, columns = GRID.window((-100.0, -100.0), (100.0, 100.0))
    assert (rows, columns) == (slice(0, 40), slice(0, 60))
    for low, high in (((5.0, 2.5), (6.0, 3.0)), ((-9.0, -9.0), (-8.0, -8.0))):
        rows, columns = GRID.window(low, high)
        assert np.zeros((GRID.rows, GRID.columns))[rows, columns].size == 0
