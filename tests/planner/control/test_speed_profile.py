"""Commands within the limits, whatever is wanted."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.schemas.base import Twist2
from rackhand.services.planner.control import speed_profile as profile
from rackhand.services.planner.settings import Limits

LIMITS = Limits()
DT = 0.04
SPEEDS, RATES = st.floats(-0.2, 1.2), st.floats(-1.2, 1.2)
TWISTS = st.builds(lambda v, w: Twist2(linear=v, angular=w), SPEEDS, RATES)


def check_step(now: Twist2, then: Twist2) -> None:
    assert LIMITS.max_backward_velocity <= then.linear <= LIMITS.max_forward_velocity
    assert abs(then.angular) <= LIMITS.max_angular_velocity
    change = (then.linear - now.linear) / DT
    speeding = abs(then.linear) > abs(now.linear)
    assert now.linear * then.linear >= 0.0
    assert abs(change) <= (LIMITS.max_forward_acc if speeding else -LIMITS.max_forward_decel) + 1e-9
    assert abs(then.angular - now.angular) / DT <= LIMITS.max_angular_acc + 1e-9


@given(TWISTS, st.floats(-3, 3), st.floats(-3, 3))
def test_a_command_keeps_all_limits_whatever_is_wanted(now: Twist2, linear: float, angular: float) -> None:
    check_step(now, profile.limited(now, linear, angular, DT, LIMITS))


@given(SPEEDS, RATES)
def test_what_is_wanted_for_long_enough_is_reached(linear: float, angular: float) -> None:
    now = Twist2(linear=0.6, angular=-0.6)
    for _ in range(150):
        now = profile.limited(now, linear, angular, DT, LIMITS)
    assert (now.linear, now.angular) == pytest.approx((linear, angular))


@given(TWISTS)
def test_braking_keeps_the_limits_never_speeds_up_and_ends_at_rest(now: Twist2) -> None:
    for _ in range(60):
        then = profile.braked(now, DT, LIMITS)
        check_step(now, then)
        assert abs(then.linear) <= abs(now.linear)
        now = then
    assert now == Twist2(linear=0.0, angular=0.0)


def test_braking_keeps_the_arc() -> None:
    then = profile.braked(Twist2(linear=1.0, angular=0.5), DT, LIMITS)
    assert then.linear == pytest.approx(1.0 - 2.0 * DT) and then.angular / then.linear == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("current", "wanted", "then"),
    [(0.5, 2.0, 0.6), (0.5, 0.0, 0.2), (0.5, -1.0, 0.2), (0.1, -1.0, 0.0), (-0.5, -2.0, -0.6), (0.0, -1.0, -0.1)],
)
def test_ramp_grows_by_rise_shrinks_by_fall_and_stops_at_0(current: float, wanted: float, then: float) -> None:
    assert profile.ramp(current, wanted, 0.1, 0.3) == pytest.approx(then)
    assert math.isfinite(then)
