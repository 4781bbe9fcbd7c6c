"""Each cost alone, by its definition in the settings."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.services.planner.control.mppi_costs import (
    backward_cost,
    collision_weight,
    dynamic_cost,
    effort_cost,
    goal_cost,
    heading_cost,
    static_cost,
)
from rackhand.services.planner.settings import MppiCosts

C = MppiCosts()
DT = 0.12


def test_a_collision_costs_less_the_later() -> None:
    assert collision_weight(0, 32, C) == C.collision
    assert collision_weight(16, 32, C) == pytest.approx(C.collision * 0.75)
    assert collision_weight(32, 32, C) == pytest.approx(C.collision * 0.5)


def test_cells() -> None:
    assert static_cost(-0.01, DT, 300.0, C) == 300.0
    assert static_cost(0.0, DT, 300.0, C) == pytest.approx(C.static_proximity * DT)
    assert static_cost(C.static_scale, DT, 300.0, C) == pytest.approx(C.static_proximity * DT / math.e)
    assert static_cost(C.static_range, DT, 300.0, C) == 0.0


def test_dynamic_obstacles() -> None:
    assert dynamic_cost(-0.2, DT, 300.0, C) == pytest.approx(360.0)
    assert dynamic_cost(0.0, DT, 300.0, C) == pytest.approx(C.dynamic_proximity * DT)
    assert dynamic_cost(2 * C.dynamic_scale, DT, 300.0, C) == pytest.approx(C.dynamic_proximity * DT / math.e**2)
    assert dynamic_cost(math.inf, DT, 300.0, C) == 0.0


@given(st.floats(-1, 1), st.floats(-1, 1))
def test_more_clearance_never_costs_more(a: float, b: float) -> None:
    near, far = min(a, b), max(a, b)
    assert static_cost(near, DT, 300.0, C) >= static_cost(far, DT, 300.0, C)
    assert dynamic_cost(near, DT, 300.0, C) >= dynamic_cost(far, DT, 300.0, C)


def test_effort_is_quadratic() -> None:
    assert effort_cost(0.0, 1.0, DT, C) == pytest.approx(C.effort * DT)
    assert effort_cost(2.0, 0.0, DT, C) == pytest.approx(C.effort * C.effort_linear * 4.0 * DT)
    assert effort_cost(0.5, -1.0, DT, C) == effort_cost(-0.5, 1.0, DT, C)


def test_only_backward_metres_cost() -> None:
    assert backward_cost(1.0, DT, C) == 0.0
    assert backward_cost(-0.2, DT, C) == pytest.approx(C.backward * 0.2 * DT)


def test_what_is_left_to_the_goal() -> None:
    assert goal_cost(3.5, 2.0, C) == 3.5
    assert goal_cost(math.inf, 2.0, C) == C.off_field + 2.0


def test_the_heading_counts_near_the_goal() -> None:
    assert heading_cost(-0.5, 0.0, C) == pytest.approx(C.heading * 0.5)
    assert heading_cost(0.5, 0.5, C) == pytest.approx(C.heading * 0.25)
    assert heading_cost(3.0, C.heading_range, C) == 0.0
