"""The detector of charging docks, on ray-cast scans with noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from rackhand.services.planner.geometry import se2
from rackhand.services.planner.perception.charger_dock import DockShape, describe_miss, find_dock
from rackhand.worlds.solids import charger_shapes
from rackhand.worlds.world_model import Charger
from tests.planner.plant import box
from tests.planner.racks import SENSOR, look

Array = NDArray[np.float64]
CHASSIS = np.array([6.0, 6.0, 0.0])
SHAPE = DockShape()


def dock(docked: Array) -> list[Array]:
    """What stands where the docked chassis would be at ``docked``, chassis frame."""
    x, y, yaw = se2.compose(se2.compose(CHASSIS, docked), np.array([-0.6, 0.0, 0.0])).tolist()
    shapes = charger_shapes(Charger(pose=(x, y, yaw), dock=(0.0, 0.0, 0.0)))
    return [box(s.x, s.y, 2 * s.a, 2 * s.b, s.yaw) for s in shapes]


def test_a_dock_is_measured_to_millimetres_from_before_it_and_on_it() -> None:
    random, errors = np.random.default_rng(4), []
    for seed in range(80):
        docked = np.array([-random.uniform(0.0, 1.2), random.normal(0, 0.03), random.normal(0, 0.05)])
        found = find_dock(look(dock(docked), seed), SENSOR, docked + random.normal(0, 0.1, 3), SHAPE)
        assert found is not None and found.hits >= 25
        errors.append(se2.between(docked, found.pose))
    assert np.abs(np.mean(errors, axis=0)).max() < 3e-3
    assert (np.std(errors, axis=0) < (0.003, 0.009, 0.018)).all()


def test_with_a_wall_behind_it() -> None:
    wall = box(6.0 - 1.0 - 0.8, 6.0, 0.1, 6.0)
    found = find_dock(look([*dock(np.array([-0.7, 0.02, 0.0])), wall]), SENSOR, np.array([-0.6, 0.0, 0.0]), SHAPE)
    assert found is not None and math.hypot(*(found.pose[:2] - (-0.7, 0.02))) < 0.03


def test_a_flat_board_a_crate_and_nothing_are_no_docks() -> None:
    prior = np.array([-0.7, 0.0, 0.0])
    for seed in range(20):
        for things in ([box(4.8, 6.0, 0.03, 0.48)], [box(4.7, 6.0, 0.35, 0.35, 0.78)], []):
            points = look(things, seed)
            assert find_dock(points, SENSOR, prior, SHAPE) is None
    assert "off the dock's shape by" in describe_miss(look([box(4.8, 6.0, 0.03, 0.48)]), SENSOR, prior, SHAPE).text
    assert describe_miss(look([]), SENSOR, prior, SHAPE).text == (
        "no V of two plates is seen within 0.6 m and 25 degrees of (-0.70, 0.00)"
    )


def test_a_dock_farther_off_or_turned_is_another_one() -> None:
    points = look(dock(np.array([-0.7, 0.0, 0.0])))
    assert find_dock(points, SENSOR, np.array([-0.7, 0.7, 0.0]), SHAPE) is None
    assert find_dock(points, SENSOR, np.array([-0.7, 0.0, 0.6]), SHAPE) is None


def test_a_dock_that_was_moved_is_named_where_it_is() -> None:
    points = look(dock(np.array([-0.7, 1.2, 0.0])))
    miss = describe_miss(points, SENSOR, np.array([-0.7, 0.0, 0.0]), SHAPE)
    (found,) = miss.things
    assert (found.kind, found.role) == ("charger", "seen") and math.hypot(found.x + 0.7, found.y - 1.2) < 0.05
    (away,) = miss.measures
    assert away.value == pytest.approx(1.2, abs=0.05) and away.expected == 0.6 and "1.2" in miss.text
