"""The pose of a rack from its legs: exact where the scan is, and little moved by one leg that is wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.perception.clusters import Clusters
from rackhand.services.planner.perception.leg_fit import fit_legs

SPEC = RackSpec(width=0.83, depth=0.83, leg_shape="round", leg_size=0.03)
HALF = 0.4
MIDDLES = np.array([(HALF, HALF), (HALF, -HALF), (-HALF, HALF), (-HALF, -HALF)])
SENSOR = np.zeros(2)
RACK = np.array([1.6, 0.2, 0.1])


def legs_at(rack: np.ndarray, closer: float = 0.0) -> Clusters:
    """As a lidar at the origin sees round legs; the first one so many metres closer than it is."""
    places = se2.transformed(rack, MIDDLES)
    ranges = np.hypot(places[:, 0], places[:, 1]) - math.pi / 4 * 0.5 * SPEC.leg_size
    ranges[0] -= closer
    bearings = np.arctan2(places[:, 1], places[:, 0])
    return Clusters(places, bearings, ranges, np.full(4, 5.0), np.full(4, math.radians(0.5)))


def test_it_finds_the_pose_from_a_start_beside_it() -> None:
    fit = fit_legs(legs_at(RACK), SENSOR, MIDDLES, SPEC, RACK + np.array([0.1, -0.08, 0.1]))
    assert fit.pose == pytest.approx(RACK, abs=1e-4)
    assert fit.rms < 1e-4 and fit.legs == pytest.approx(se2.transformed(RACK, MIDDLES), abs=1e-3)


def test_a_leg_that_is_wrong_counts_less() -> None:
    fit = fit_legs(legs_at(RACK, closer=0.1), SENSOR, MIDDLES, SPEC, RACK)
    assert np.abs(fit.pose - RACK)[:2].max() < 0.02 and fit.rms > 0.01
