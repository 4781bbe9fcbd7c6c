"""Commands within the limits, whatever is wanted."""

from __future__ import annotations

import math
from itertools import pairwise

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


BUILD_UP = 0.2  # s


def stream(wanted: list[float], build_up: float = BUILD_UP, start: float = 0.0) -> list[float]:
    """The speeds commanded for a wanted speed each tick."""
    speeds, acceleration, now = [start], 0.0, Twist2(linear=start, angular=0.0)
    for speed in wanted:
        then = profile.smoothed(now, speed, 0.0, DT, LIMITS, acceleration, build_up)
        acceleration = (then.linear - now.linear) / DT
        now = then
        speeds.append(now.linear)
    return speeds


@given(st.lists(st.tuples(st.floats(-0.3, 1.5), st.integers(1, 40)), min_size=1, max_size=8))
def test_a_stream_keeps_speeds_accelerations_and_jerk(pieces: list[tuple[float, int]]) -> None:
    wanted = [speed for speed, ticks in pieces for _ in range(ticks)]
    speeds = stream(wanted)
    slowest, fastest = LIMITS.max_backward_velocity, LIMITS.max_forward_velocity
    most, hardest = LIMITS.max_forward_acc, -LIMITS.max_forward_decel
    assert all(slowest - 1e-9 <= speed <= fastest + 1e-9 for speed in speeds)
    before = 0.0
    for speed, then in pairwise(speeds):
        change = (then - speed) / DT
        if abs(then) <= abs(speed):
            assert abs(change) <= hardest + 1e-9
        else:
            assert abs(change) <= most + 1e-9
            if change * before >= 0.0:
                assert abs(change) - abs(before) <= most / BUILD_UP * DT + 1e-9
        before = change


@given(st.floats(0.0, 1.2), st.floats(0.0, 1.2))
def test_a_speed_that_must_fall_falls_as_fast_as_without_a_build_up(start: float, wanted: float) -> None:
    smooth, hard = stream([wanted] * 40, start=start), stream([wanted] * 40, build_up=0.0, start=start)
    assert all(a <= b + profile.SLACK + 1e-9 for a, b in zip(smooth, hard, strict=True))
    assert all(speed >= min(start, wanted) - 1e-9 for speed in smooth)


@pytest.mark.parametrize("decel", [0.2, 0.4])
def test_the_way_to_a_foreseen_stop_keeps_the_jerk(decel: float) -> None:
    wanted = [1.0] * 60 + [max(1.0 - decel * DT * k, 0.0) for k in range(round(1.0 / decel / DT) + 20)]
    changes = [(b - a) / DT for a, b in pairwise(stream(wanted))]
    jerks = [abs(b - a) / DT for a, b in pairwise(changes)]
    assert max(jerks) <= -LIMITS.max_forward_decel / BUILD_UP + 1e-9
    assert stream(wanted)[-1] == 0.0


def test_an_acceleration_builds_up_and_ends_at_the_wanted_speed() -> None:
    speeds = stream([1.0] * 80)
    changes = [(b - a) / DT for a, b in pairwise(speeds)]
    steps = [b - a for a, b in pairwise([0.0, *changes])]
    assert max(map(abs, steps)) <= LIMITS.max_forward_acc / BUILD_UP * DT + 1e-9
    assert max(changes) == pytest.approx(LIMITS.max_forward_acc)
    assert max(speeds) <= 1.0 + 1e-9 and speeds[-1] == pytest.approx(1.0)
    late = next(k for k, v in enumerate(speeds) if v > 0.99) - next(
        k for k, v in enumerate(stream([1.0] * 80, 0.0)) if v > 0.99
    )
    assert 0 < late * DT <= 1.5 * BUILD_UP, "little time is lost"


@pytest.mark.parametrize("hardest", [-0.1, -0.5, -2.0])
@pytest.mark.parametrize("most", [0.1, 0.5, 50.0])
def test_a_wanted_speed_is_not_exceeded_whichever_limit_is_the_tighter(most: float, hardest: float) -> None:
    limits, now, acceleration = (
        LIMITS._replace(max_forward_acc=most, max_forward_decel=hardest),
        Twist2(linear=0.0, angular=0.0),
        0.0,
    )
    for _ in range(300):
        then = profile.smoothed(now, 0.5, 0.0, DT, limits, acceleration, BUILD_UP)
        acceleration, now = (then.linear - now.linear) / DT, then
        assert now.linear <= 0.5 + 1e-9
    assert now.linear == pytest.approx(0.5)


@given(TWISTS, st.floats(-3, 3), st.floats(-3, 3))
def test_without_a_build_up_it_is_the_former_command(now: Twist2, linear: float, angular: float) -> None:
    assert profile.smoothed(now, linear, angular, DT, LIMITS, 0.3, 0.0) == profile.limited(
        now, linear, angular, DT, LIMITS
    )
