"""The tightest place of the widest way."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.planning.bottleneck import bottleneck

G = Geometry(0.0, 0.0, 0.05, 80, 120)
START, GOAL = (1.0, 2.0), (5.0, 2.0)


def wall(*gaps: tuple[float, float]) -> np.ndarray:
    """A hall with a wall of one cell across its middle, x = 3, and gaps between two y."""
    blocked = np.zeros((G.rows, G.columns), dtype=np.bool_)
    blocked[0], blocked[-1], blocked[:, 0], blocked[:, -1] = True, True, True, True
    blocked[:, 60] = True
    for low, high in gaps:
        blocked[round(low / 0.05) : round(high / 0.05), 60] = False
    return blocked


def test_a_way_that_is_wide_enough_has_no_bottleneck() -> None:
    assert bottleneck(wall((1.0, 2.0)), G, START, GOAL, 0.3) is None


def test_a_gap_that_is_too_narrow_is_named_with_its_width() -> None:
    found = bottleneck(wall((3.0, 3.3)), G, START, GOAL, 0.3)
    assert found is not None
    assert (found.x, found.y) == pytest.approx((3.0, 3.15), abs=0.08)
    assert found.radius == pytest.approx(0.15, abs=0.04)
    assert found.blocked_x == pytest.approx(3.025, abs=0.03)


def test_of_two_gaps_the_wider_one_is_named() -> None:
    found = bottleneck(wall((0.5, 0.7), (3.0, 3.3)), G, START, GOAL, 0.3)
    assert found is not None
    assert found.y == pytest.approx(3.15, abs=0.08)


def test_a_long_passage_is_named_though_the_goal_is_near_behind_a_wall_elsewhere() -> None:
    blocked = wall((2.95, 3.35))
    blocked[58, 30:60] = blocked[67, 30:60] = True  # the passage begins 1.5 m before the wall
    found = bottleneck(blocked, G, START, GOAL, 0.3)
    assert found is not None
    assert 1.4 < found.x < 3.2 and found.y == pytest.approx(3.15, abs=0.1), found
    assert found.radius == pytest.approx(0.2, abs=0.04)


def test_a_wall_without_a_gap_is_named_where_it_is_crossed_on_the_straight_line() -> None:
    found = bottleneck(wall(), G, START, GOAL, 0.3)
    assert found is not None
    assert (found.radius, found.blocked_x) == (0.0, pytest.approx(3.025))
    assert found.blocked_y == pytest.approx(2.0, abs=0.06)


@pytest.mark.parametrize("swapped", [False, True])
def test_a_place_beside_a_wall_is_the_bottleneck_itself_where_the_way_is_wide(swapped: bool) -> None:
    beside = (4.0, 0.35)  # the wall ends at y = 0.05
    ends = (beside, START) if swapped else (START, beside)
    found = bottleneck(wall((1.0, 3.0)), G, *ends, 0.44)
    assert found is not None
    assert (found.x, found.y) == pytest.approx(beside, abs=0.03)
    assert found.radius == pytest.approx(0.3, abs=0.03)
    assert (found.blocked_x, found.blocked_y) == pytest.approx((4.0, 0.025), abs=0.03)


def test_ends_without_room_have_none() -> None:
    blocked = wall()
    blocked[40, 20] = True
    assert bottleneck(blocked, G, (1.02, 2.02), GOAL, 0.3) is None
    assert bottleneck(blocked, G, (-1.0, 2.0), GOAL, 0.3) is None
