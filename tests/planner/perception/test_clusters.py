"""Small clusters of a scan: legs are kept, walls and single near hits are not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.services.planner.perception.clusters import small_clusters

SENSOR = np.zeros(3)


def arc(bearing: float, away: float, count: int, step: float = math.radians(0.5)) -> np.ndarray:
    """Hits around a bearing, in the order of the beams."""
    angles = bearing + step * (np.arange(count) - (count - 1) / 2)
    return away * np.column_stack([np.cos(angles), np.sin(angles)])


def test_a_leg_is_a_cluster_with_its_bearing_range_and_number_of_hits() -> None:
    found = small_clusters(np.vstack([arc(0.5, 2.0, 3), arc(1.5, 1.0, 5)]), SENSOR)
    assert found.number == 2
    assert found.bearings == pytest.approx([0.5, 1.5]) and found.counts == pytest.approx([3, 5])
    assert found.ranges == pytest.approx([2.0, 1.0]) and found.steps == pytest.approx(math.radians(0.5))
    assert found.at(np.array([1])).bearings == pytest.approx([1.5])


def test_what_is_wider_than_a_leg_is_none() -> None:
    assert small_clusters(arc(0.0, 2.0, 60), SENSOR).number == 0


def test_a_single_hit_is_a_leg_far_away_only() -> None:
    assert small_clusters(np.vstack([arc(0.0, 1.0, 1), arc(1.0, 3.0, 1)]), SENSOR).ranges == pytest.approx([3.0])


def test_a_cluster_across_the_first_beam_is_one() -> None:
    behind = arc(math.pi, 2.0, 4)
    points = np.vstack([behind[2:], arc(0.0, 2.0, 3), behind[:2]])
    found = small_clusters(points, SENSOR)
    assert sorted(found.counts.tolist()) == [3, 4]
