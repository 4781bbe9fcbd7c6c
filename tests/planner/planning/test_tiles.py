"""Clearances by tiles are those of the whole map, near what is asked about."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.tiles import KEPT, MARGIN, TiledClearance
from tests.planner.plant import BODY

GEOMETRY = Geometry(-6.0, -5.0, 0.1, 200, 300)


@pytest.fixture
def blocked() -> np.ndarray:
    cells = np.random.default_rng(3).random((GEOMETRY.rows, GEOMETRY.columns)) < 0.002
    return np.asarray(cells)


def test_they_are_those_of_the_whole_map(blocked: np.ndarray) -> None:
    tiles, whole, body = TiledClearance(blocked, GEOMETRY), DistanceGrid.of(blocked, GEOMETRY), Footprint.of(BODY)
    for x, y, yaw in np.random.default_rng(4).uniform((-5, -4, -3), (23, 14, 3), (200, 3)):
        assert min(tiles.at(x, y), MARGIN) == pytest.approx(min(whole.at(x, y), MARGIN))
        pose = np.array([x, y, yaw])
        assert tiles.clearance(body, pose) == pytest.approx(whole.clearance(body, pose))
        assert tiles.turn_clearance(body, pose, 1.0) == pytest.approx(whole.turn_clearance(body, pose, 1.0))


def test_outside_the_map_nothing_is_free(blocked: np.ndarray) -> None:
    assert TiledClearance(blocked, GEOMETRY).at(-7.0, 0.0) <= 0.0


def test_no_more_tiles_are_kept_than_needed(blocked: np.ndarray) -> None:
    tiles = TiledClearance(blocked, GEOMETRY)
    for x in np.arange(-6.0, 24.0, 2.0):
        for y in np.arange(-5.0, 15.0, 2.0):
            tiles.at(x, y)
    assert len(tiles._grids) <= KEPT
