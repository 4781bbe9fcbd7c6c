"""Evidence from scans: one hit makes an obstacle, rays clear it, the map and the own body are none."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Scan
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.map.grid import load_map
from rackhand.services.planner.perception.observed import SCAN_PERIOD, ObservedObstacles
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import BODY, Hall

EDGES = Footprint.of(BODY).edges
HERE = np.array([2.0, 2.0, 0.0])
S = NavigationSettings()


def observed(settings: NavigationSettings = S) -> ObservedObstacles:
    """A hall of 8 x 4 m without anything in it."""
    return ObservedObstacles(load_map(Hall(8, 4).map(), 0.4), settings)


def scan(*hits: tuple[float, float]) -> Scan:
    """36 beams from the chassis' origin; those at (index, metres) return, the others see nothing to 5 m."""
    ranges = np.full(36, math.inf, dtype="<f4")
    for index, metres in hits:
        ranges[int(index)] = metres
    return Scan(
        stamp=0, sensor=Pose2(x=0.0, y=0.0, yaw=0.0), angle_min=0.0, angle_step=math.pi / 18, range_max=5.0,
        ranges=ranges,
    )  # fmt: skip


def cell(found: ObservedObstacles, x: float, y: float) -> bool:
    return bool(found.occupied()[found._static.geometry.cell(x, y)])


def test_one_hit_is_an_obstacle_at_its_place() -> None:
    found = observed()
    found.integrate(scan((0, 2.03)), HERE, EDGES)
    assert found.points == pytest.approx(np.array([(4.03, 2.0)]), abs=1e-6)
    assert found.unmapped.tolist() == [True]
    assert cell(found, 4.03, 2.0) and found.occupied().sum() == 1


def test_a_hit_is_placed_by_pose_and_sensor() -> None:
    found = observed()
    turned = scan((9, 1.02)).model_copy(update={"sensor": Pose2(x=0.2, y=0.0, yaw=0.0)})
    found.integrate(turned, np.array([4.0, 2.0, math.pi / 2]), EDGES)
    assert found.points == pytest.approx(np.array([(4.0 - 1.02, 2.2)]), abs=1e-6)


def test_rays_through_it_clear_it() -> None:
    found = observed()
    for _ in range(5):
        found.integrate(scan((0, 2.03)), HERE, EDGES)
    found.integrate(scan((0, 3.0)), HERE, EDGES)
    assert cell(found, 4.03, 2.0)
    found.integrate(scan((0, 3.0)), HERE, EDGES)
    assert not cell(found, 4.03, 2.0) and found.is_seen_free(np.array([4.03, 2.0]))
    assert not found.is_seen_free(np.array([5.5, 2.0])) and not found.is_seen_free(np.array([50.0, 2.0]))


def test_a_beam_without_a_return_is_free_and_one_without_a_measurement_says_nothing() -> None:
    found = observed()
    for _ in range(5):
        found.integrate(scan((0, 2.03), (3, 1.03)), HERE, EDGES)
    for _ in range(2):
        found.integrate(scan((0, math.nan), (3, math.inf)), HERE, EDGES)
    assert found.occupied().sum() == 1 and cell(found, 4.03, 2.0)
    assert found.is_seen_free(np.array([4.0 + 1.03 * math.cos(math.pi / 6), 2.0 + 1.03 * math.sin(math.pi / 6)]))


def test_a_hit_within_noise_of_a_firm_cell_is_one_of_it() -> None:
    found = observed()
    for _ in range(2):
        found.integrate(scan((0, 2.01)), HERE, EDGES)
    for reach in (1.985, 2.055, 1.985):  # 15 mm before it, 5 mm behind it
        found.integrate(scan((0, reach)), HERE, EDGES)
        assert found.unmapped.tolist() == [True]
        assert cell(found, 4.01, 2.0) and found.occupied().sum() == 1
    found.integrate(scan((0, 1.96)), HERE, EDGES)
    assert cell(found, 3.96, 2.0), "40 mm before it is another thing, seen at the first hit"


def test_a_cell_hit_once_owns_no_hit_beside_it() -> None:
    found = observed()
    found.integrate(scan((0, 2.01)), HERE, EDGES)
    found.integrate(scan((0, 1.99)), HERE, EDGES)
    assert cell(found, 3.99, 2.0)


def wall_beside(y: float, noise: float, rng: np.random.Generator) -> Scan:
    """Half a degree between beams; they end at a wall along x, ``y`` metres beside the sensor, from 0.3 m behind it
    to 0.3 m ahead."""
    angles = np.arange(720) * math.pi / 360
    with np.errstate(divide="ignore"):
        ranges = y / np.sin(angles)
    ranges[(ranges <= 0.0) | (np.abs(ranges * np.cos(angles)) > 0.3)] = math.inf
    ranges += noise * rng.standard_normal(720)
    return Scan(
        stamp=0, sensor=Pose2(x=0.0, y=0.0, yaw=0.0), angle_min=0.0, angle_step=math.pi / 360, range_max=5.0,
        ranges=ranges.astype("<f4"),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("off", [-0.006, 0.0, 0.006])
def test_the_cells_of_a_wall_at_the_edge_of_cells_do_not_flicker(off: float, seed: int) -> None:
    rng, found, seen = np.random.default_rng(seed), observed(), []
    for _ in range(50):
        found.integrate(wall_beside(0.3, 0.01, rng), HERE + np.array([0.0, off, 0.0]), EDGES)
        seen.append(found.occupied().copy())
    assert sum((a != b).any() for a, b in pairwise(seen[10:])) <= 8, "16 to 34 of 39 without slack and means"
    rows, columns = np.nonzero(seen[-1])
    assert set(columns) == set(range(34, 46)) and set(rows) <= {45, 46}
    if off > 0.0:
        assert set(rows) == {46}, "what the noise of the first scans put before the wall is gone"


def test_a_wall_that_comes_nearer_is_seen_at_once() -> None:
    rng, found = np.random.default_rng(0), observed()
    for _ in range(20):
        found.integrate(wall_beside(0.32, 0.01, rng), HERE, EDGES)
    assert not cell(found, 2.0, 2.27)
    found.integrate(wall_beside(0.27, 0.01, rng), HERE, EDGES)
    assert cell(found, 2.0, 2.27)


def test_one_beam_on_something_thin_is_an_obstacle_where_it_ends() -> None:
    rng, found = np.random.default_rng(0), observed()
    ranges = wall_beside(0.5, 0.0, rng).ranges.copy()
    ranges[180] = 0.38  # straight to the side, 12 cm before the wall
    found.integrate(wall_beside(0.5, 0.0, rng).model_copy(update={"ranges": ranges}), HERE, EDGES)
    assert cell(found, 2.0, 2.38)


def test_hits_on_the_map_and_on_the_body_are_none() -> None:
    found = observed()
    found.integrate(scan((9, 1.78), (0, 0.3)), HERE, EDGES)  # the wall at y = 3.8, the front of the chassis
    assert len(found.points) == 1 and found.unmapped.tolist() == [False]
    assert not found.occupied().any()


def test_fresh_is_what_comes_to_where_nothing_was_a_moment_ago() -> None:
    found = observed()
    found.integrate(scan((0, 2.03)), HERE, EDGES)
    assert found.fresh.tolist() == [False]  # nothing was seen there before
    for _ in range(3):
        found.integrate(scan(), HERE, EDGES)
    found.integrate(scan((0, 1.53)), HERE, EDGES)
    assert found.fresh.tolist() == [True]
    for _ in range(12):
        found.integrate(scan((0, 1.53)), HERE, EDGES)
    assert found.fresh.tolist() == [False]


def test_what_is_not_seen_again_is_forgotten_what_moves_sooner() -> None:
    settings = NavigationSettings(forget_after=20 * SCAN_PERIOD, forget_mover_after=5 * SCAN_PERIOD)
    found, away = observed(settings), np.array([2.0, 2.0, math.pi])
    found.integrate(scan((0, 2.03), (3, 1.0)), HERE, EDGES)
    found.shorten(np.array([4.03, 2.0]), 0.2)
    blind = scan().model_copy(update={"ranges": np.full(36, -1.0, dtype="<f4")})
    counts = []
    for _ in range(25):
        found.integrate(blind, away, EDGES)
        counts.append(int(found.occupied().sum()))
    assert counts[3] == 2 and counts[6] == 1 and counts[-1] == 0


@pytest.mark.parametrize("written", [0, 10**6])
def test_a_map_too_large_to_be_written_beforehand_is_observed_alike(
    written: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rackhand.services.planner.perception.observed.WRITTEN_CELLS", written)
    found = observed()
    for array in found._evidence[2:]:
        assert array.shape == (80, 160) and array.flags.writeable and array.flags.c_contiguous and not array.any()
    for _ in range(3):
        found.integrate(scan((0, 2.03)), HERE, EDGES)
    assert cell(found, 4.03, 2.0) and found.occupied().sum() == 1
    assert found.is_seen_free(np.array([3.5, 2.0])) and not found.is_seen_free(np.array([4.03, 2.0]))
