from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.planning.field import FAR, cell_value, distance_field, sample


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


def test_the_value_of_a_cell_and_of_none() -> None:
    field, geometry = np.arange(12, dtype=np.float32).reshape(3, 4), Geometry(1.0, -1.0, 0.5, 3, 4)
    assert cell_value(field, geometry, 1.99, -0.01, -7.0) == 5.0
    for x, y in ((0.99, 0.0), (3.01, 0.0), (1.1, -1.01), (1.1, 0.51)):
        assert cell_value(field, geometry, x, y, -7.0) == -7.0


def test_far_is_metres() -> None:
    assert distance_field(np.zeros((2, 2), dtype=np.bool_), 0.05).max() == pytest.approx(FAR * 0.05)
