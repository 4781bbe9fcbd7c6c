from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from tests.planner.plant import BODY

FOOTPRINT = Footprint.of(BODY)


def brute_clearance(blocked: np.ndarray, resolution: float, pose: np.ndarray) -> float:
    rows, columns = np.nonzero(blocked)
    points = (np.column_stack([columns, rows]) + 0.5) * resolution - pose[:2]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    local = points @ np.array([(c, -s), (s, c)])
    outside = np.maximum(np.abs(local) - (0.375, 0.23), 0.0)
    return float(np.hypot(*outside.T).min()) - 0.5 * resolution


@pytest.mark.parametrize("seed", range(4))
def test_body_clearance_agrees_with_brute_force(seed: int) -> None:
    random = np.random.default_rng(seed)
    blocked = random.random((80, 80)) < 0.004
    grid = DistanceGrid.of(blocked, Geometry(0.0, 0.0, 0.05, 80, 80))
    body = Footprint.of(BODY)
    seen = set()
    for _ in range(300):
        pose = np.array([*random.uniform(0.8, 3.2, 2), random.uniform(-4, 4)])
        exact, found = brute_clearance(blocked, 0.05, pose), grid.clearance(body, pose)
        if exact > 0.0:
            assert found == pytest.approx(min(exact, max(found, 1.0)), abs=0.03)
            seen.add("free")
        elif exact < -0.02:
            assert found < 0.0
            seen.add("hit")
    assert seen == {"free", "hit"}


def wall_at(x: float) -> DistanceGrid:
    """4 x 4 m, blocked from ``x`` on."""
    blocked = np.zeros((80, 80), dtype=np.bool_)
    blocked[:, round(x / 0.05) :] = True
    return DistanceGrid.of(blocked, Geometry(0.0, 0.0, 0.05, 80, 80))


def test_distance_of_a_point_is_to_the_edge_of_the_cell() -> None:
    assert wall_at(3.0).at(2.0, 2.0) == pytest.approx(1.0, abs=1e-5)


def test_a_turn_is_as_free_as_its_worst_heading() -> None:
    grid, pose = wall_at(3.0), np.array([2.7, 2.0, math.pi / 2])
    assert grid.clearance(FOOTPRINT, pose) == pytest.approx(0.3 - 0.23, abs=0.02)
    assert grid.turn_clearance(FOOTPRINT, pose, 0.1) > 0.0
    assert grid.turn_clearance(FOOTPRINT, pose, math.pi) < 0.0
    far = np.array([1.5, 2.0, 0.0])
    assert grid.turn_clearance(FOOTPRINT, far, 2 * math.pi, 1.0) == pytest.approx(1.5 - 0.44, abs=0.03)


def test_outside_nothing_is_free() -> None:
    assert wall_at(4.0).clearance(FOOTPRINT, np.array([-1.0, 2.0, 0.0])) < 0.0
