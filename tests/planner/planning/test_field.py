from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.planning.cost_to_go import cost_to_go
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.field import distance_field, sample
from rackhand.services.planner.planning.inflation import Inflation
from tests.planner.plant import BODY


@pytest.mark.parametrize("seed", range(5))
def test_distance_field_is_exact(seed: int) -> None:
    blocked = np.random.default_rng(seed).random((37, 53)) < 0.03
    assert distance_field(blocked, 0.05) == pytest.approx(distance_transform_edt(~blocked) * 0.05, abs=1e-5)


def test_nothing_blocked_is_far() -> None:
    assert distance_field(np.zeros((5, 6), dtype=np.bool_), 0.05).min() > 1e3


def test_sample_is_0_outside_and_exact_at_centres() -> None:
    field = np.arange(12, dtype=np.float32).reshape(3, 4)
    geometry = Geometry(0.0, 0.0, 1.0, 3, 4)
    assert sample(field, geometry, 2.5, 1.5) == pytest.approx(6.0)
    assert sample(field, geometry, 2.0, 1.5) == pytest.approx(5.5)
    assert sample(field, geometry, -3.0, 1.5) == 0.0


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
    room = DistanceGrid.of(blocked, Geometry(0.0, 0.0, 0.05, 80, 80))
    body = Footprint.of(BODY)
    seen = set()
    for _ in range(300):
        pose = np.array([*random.uniform(0.8, 3.2, 2), random.uniform(-4, 4)])
        exact, found = brute_clearance(blocked, 0.05, pose), room.clearance(body, pose)
        if exact > 0.0:
            assert found == pytest.approx(min(exact, max(found, 1.0)), abs=0.03)
            seen.add("free")
        elif exact < -0.02:
            assert found < 0.0
            seen.add("hit")
    assert seen == {"free", "hit"}


@pytest.mark.parametrize(
    "polygon",
    [
        [(0, 0), (1, 0)],
        [(1, 1), (2, 1), (2, 2)],
        [(1, 0), (0.1, 0.1), (0, 1), (-1, -1)],
        [(1, 0), (0, 1), (float("nan"), 0)],
    ],
)
def test_footprint_must_be_convex_around_the_origin(polygon: list) -> None:
    with pytest.raises(ValueError, match="footprint"):
        Footprint.of(np.array(polygon, dtype=float))


def test_footprint_either_way_round() -> None:
    one, other = Footprint.of(BODY), Footprint.of(BODY[::-1])
    assert one.inscribed == other.inscribed == pytest.approx(0.23)
    assert one.circumscribed == other.circumscribed == pytest.approx(math.hypot(0.375, 0.23))
