"""Limits with a load: never above those without, and lower with each kilogram."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.schemas.base import Twist2
from rackhand.services.planner.control.braking_guard import as_obstacles, braking_is_free
from rackhand.services.planner.control.load_limits import FULL_ACC, FULL_ANGULAR_ACC, FULL_DECEL, load_limits
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.settings import Limits, NavigationSettings

OWN = Limits()
some = st.floats(0.1, 5.0)
shares = st.floats(0.0, 1.0)


def test_without_a_load_nothing_is_limited() -> None:
    assert load_limits(OWN, 0.0) == OWN


def test_with_the_greatest_load_the_limits_are_those_for_it() -> None:
    full = load_limits(OWN, 1.0)
    assert full == OWN._replace(
        max_forward_acc=FULL_ACC, max_forward_decel=-FULL_DECEL, max_angular_acc=FULL_ANGULAR_ACC
    )
    assert load_limits(OWN, 3.0) == full, "more than it should carry is no better"
    assert load_limits(OWN, -0.01) == OWN, "the sensor of an empty jack reads less than nothing, too"


@given(some, some, some, shares, shares)
def test_more_load_never_allows_more(acc: float, decel: float, turn: float, a: float, b: float) -> None:
    own = OWN._replace(max_forward_acc=acc, max_forward_decel=-decel, max_angular_acc=turn)
    less, more = load_limits(own, min(a, b)), load_limits(own, max(a, b))
    assert more.within(less) == more and less.within(own) == less
    assert more.standstill() is None and min(more.max_forward_acc, -more.max_forward_decel) > 0


def test_the_braking_guard_foresees_the_longer_stop() -> None:
    """At 1 m/s, the edge of an obstacle 0.45 m before the front: v²/2a and what the drive lags behind."""
    body = Footprint.of(np.array([(1, -1), (1, 1), (-1, 1), (-1, -1)]) * (0.375, 0.23))
    ahead = as_obstacles(np.array([(0.375 + 0.45, y) for y in np.linspace(-0.2, 0.2, 9)]), 0.01)
    twist = Twist2(linear=1.0, angular=0.0)

    def is_free(load: float) -> bool:
        settings = NavigationSettings(own=load_limits(OWN, load))
        return braking_is_free(np.zeros(3), twist, twist, 0.04, ahead, body.edges, settings)

    assert [is_free(load) for load in (0.0, 1.0)] == [True, False]


@pytest.mark.parametrize("load", [0.0, 0.5, 1.0])
def test_what_is_commanded_is_within_what_a_stop_may_use(load: float) -> None:
    own = load_limits(OWN, load)
    settings = NavigationSettings(own=own).commanding(OWN.within(own))
    assert settings.control == own and 0 < settings.approach_decel < -own.max_forward_decel
