"""Evidence from scans: one hit makes an obstacle, rays clear it, the map and the own body are none."""

from __future__ import annotations

import math

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
