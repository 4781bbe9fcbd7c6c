"""Corridors: plans in one never leave it, and fail where it is blocked."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.planning.corridor import Corridor
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.plan import GlobalPlanner, NoPathFound, Plan, Target
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import BODY, Array, off_line

GEOMETRY = Geometry(0.0, 0.0, 0.05, 160, 240)
LINE = np.column_stack([np.linspace(1.0, 11.0, 201), np.full(201, 4.0)])
BENT = np.vstack([LINE[:101], np.column_stack([np.full(60, 6.0), np.linspace(4.05, 7.0, 60)])])


def hall(*blocks: tuple[float, float, float, float]) -> Array:
    """Blocked cells (rows, columns): walls, and blocks from x0, y0 to x1, y1."""
    mask = np.zeros((GEOMETRY.rows, GEOMETRY.columns), dtype=np.bool_)
    mask[[0, -1]] = mask[:, [0, -1]] = True
    for x0, y0, x1, y1 in blocks:
        mask[round(y0 / 0.05) : round(y1 / 0.05), round(x0 / 0.05) : round(x1 / 0.05)] = True
    return mask


def plan(line: Array, width: float, blocked: Array, goal: tuple[float, float, float]) -> Plan:
    planner = GlobalPlanner(GEOMETRY, Footprint.of(BODY), NavigationSettings())
    steps = planner.search(np.array([1.5, 4.0, 0.0]), Target(*goal), blocked, corridor=Corridor(line, width))
    while True:
        try:
            next(steps)
        except StopIteration as found:
            result = found.value
            assert isinstance(result, Plan)
            return result


def points(found: Plan) -> Array:
    return np.vstack([segment.points for segment in found.segments])


@pytest.mark.parametrize("width", [0.58, 0.7, 1.0])
def test_round_a_block_within_the_width(width: float) -> None:
    rows = points(plan(LINE, width, hall((5.0, 3.75, 5.5, 4.25)), (9.0, 4.0, 0.0)))
    off = [off_line(LINE, row[:2]) for row in rows]
    assert 0.45 < max(off) <= width + 0.001
    assert math.dist(rows[-1, :2], (9.0, 4.0)) < 1e-6


def test_a_corner_is_cut_by_no_more_than_the_width() -> None:
    for width in (0.3, 0.6):
        rows = points(plan(BENT, width, hall(), (6.0, 6.9, math.pi / 2)))
        assert max(off_line(BENT, row[:2]) for row in rows) <= width + 0.001


@pytest.mark.parametrize("width", [0.3, 0.5])
def test_too_narrow_is_no_path(width: float) -> None:
    with pytest.raises(NoPathFound):
        plan(LINE, width, hall((5.0, 3.75, 5.5, 4.25)), (9.0, 4.0, 0.0))


def test_the_narrowed_grid_has_the_clearance_to_the_edge_of_the_corridor() -> None:
    grid = DistanceGrid.of(hall((5.0, 3.75, 5.5, 4.25)), GEOMETRY)
    narrow = Corridor(LINE, 0.6).narrowed(grid, 0.2)
    on_line, beside = narrow.distance[80, 40], narrow.distance[88, 40]  # 0.025 m and 0.425 m off it
    assert on_line == pytest.approx(0.6 - 0.025 + 0.025 + 0.2, abs=1e-5)
    assert beside == pytest.approx(0.6 - 0.425 + 0.025 + 0.2, abs=1e-5)
    assert narrow.distance[100, 40] == 0.0 and narrow.distance[78, 102] == 0.0
    assert (narrow.distance <= grid.distance).all()


def test_rows_outside_are_moved_to_the_edge() -> None:
    rows = np.array([(5.0, 4.7, 0.3), (5.0, 4.2, 0.1)])
    assert Corridor(LINE, 0.6).kept(rows).tolist() == [[5.0, pytest.approx(4.6), 0.3], [5.0, 4.2, 0.1]]
