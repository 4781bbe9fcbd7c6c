"""Two legs at a registered point: which racks they can be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.perception.clusters import Clusters
from rackhand.services.planner.perception.partial_rack import OFF, TURNED, racks_of_two_legs
from rackhand.services.planner.perception.rack_legs import leg_middles

STANDARD, LARGE = RackSpec(width=0.83, depth=0.83), RackSpec(width=0.9, depth=1.2)
PLACE = np.array([3.0, 1.0, math.pi / 2])


def seen(middles: np.ndarray) -> Clusters:
    """Clusters there; the search takes nothing else of them."""
    rest = np.ones(len(middles))
    return Clusters(middles, rest, rest, rest, rest)


def two_legs(pose: np.ndarray, legs: tuple[int, int] = (0, 1), spec: RackSpec = STANDARD) -> Clusters:
    return seen(se2.transformed(pose, leg_middles(spec)[list(legs)]))


@pytest.mark.parametrize("legs", [(0, 1), (1, 2), (0, 3), (0, 2)])
def test_any_two_legs_tell_where_the_rack_is(legs: tuple[int, int]) -> None:
    pose = PLACE + np.array([0.04, -0.03, 0.05])
    found = racks_of_two_legs(two_legs(pose, legs), PLACE, [STANDARD])
    assert found and found[0][1] is STANDARD
    assert min(np.abs(at - pose).max() for at, _ in found) < 1e-9


def test_the_kind_whose_legs_are_so_far_apart_is_found() -> None:
    long_side = next(
        (i, j)
        for i in range(4)
        for j in range(i)
        if math.dist(*leg_middles(LARGE)[[i, j]]) == pytest.approx(max(leg_middles(LARGE).max(axis=0)) * 2)
    )
    found = racks_of_two_legs(two_legs(PLACE, long_side, LARGE), PLACE, [STANDARD, LARGE])
    assert {spec.depth for _, spec in found} == {LARGE.depth}


@pytest.mark.parametrize("off", [[1.5 * OFF, 0.0, 0.0], [0.0, 0.0, 1.5 * TURNED]])
def test_legs_too_far_off_the_point_or_turned_are_none(off: list[float]) -> None:
    assert racks_of_two_legs(two_legs(PLACE + np.array(off)), PLACE, [STANDARD]) == []


def test_one_leg_or_two_things_of_another_distance_are_none() -> None:
    legs = se2.transformed(PLACE, leg_middles(STANDARD))
    assert racks_of_two_legs(seen(legs[:1]), PLACE, [STANDARD]) == []
    assert racks_of_two_legs(seen(legs[:2] + np.array([[0.1, 0.1], [-0.1, -0.1]])), PLACE, [STANDARD]) == []
