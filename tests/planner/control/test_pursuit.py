from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.services.planner.control.pursuit import (
    CREEP,
    SLOWEST_TURN,
    Tracker,
    approach_speed,
    carrot,
    curvature,
    lengths_left,
    nearest,
    regulated_speed,
    turn_rate,
)
from rackhand.services.planner.planning.plan import Segment
from rackhand.services.planner.settings import NavigationSettings

S = NavigationSettings()
LINE = np.column_stack([np.arange(0.0, 5.01, 0.05), np.zeros(101), np.zeros(101)])
BACKWARD = LINE * (-1.0, 1.0, 1.0)


def test_nearest_point_from_an_index_on_within_reach() -> None:
    assert nearest(LINE, 0, 1.02, 0.3, 9.0) == (20, pytest.approx(math.hypot(0.02, 0.3)))
    assert nearest(LINE, 40, 1.02, 0.3, 9.0)[0] == 40  # not back
    assert nearest(LINE, 0, 4.0, 0.0, 1.0)[0] == 20  # not farther than the reach


@given(st.floats(0.0, 5.0), st.floats(-0.2, 0.2), st.floats(0.3, 0.9))
def test_the_look_ahead_point_is_at_its_distance_and_on_the_line_or_beyond_it(x: float, y: float, reach: float) -> None:
    index, _ = nearest(LINE, 0, x, y, 9.0)
    px, py = carrot(LINE, index, x, y, reach)
    assert py == pytest.approx(0.0, abs=1e-9)
    assert reach - 0.05 <= math.hypot(px - x, py - y) <= reach + 0.06
    assert px > x


def test_lengths_left_add_up_to_the_length() -> None:
    left = lengths_left(LINE)
    assert left[0] == pytest.approx(5.0) and left[-1] == 0.0 and left[50] == pytest.approx(2.5)


def test_tracker_knows_what_is_left_and_what_was_overrun() -> None:
    tracker = Tracker(Segment(LINE))
    pose = np.array([1.0, 0.1, 0.0])
    tracker.update(pose)
    assert (tracker.index, tracker.deviation) == (20, pytest.approx(0.1))
    assert tracker.left(pose) == pytest.approx(4.0, abs=0.01)
    assert tracker.overrun(np.array([5.1, 0.0, 0.0])) == pytest.approx(0.1)
    assert Tracker(Segment(BACKWARD, backward=True)).overrun(np.array([-5.1, 0.0, 0.0])) == pytest.approx(0.1)


@pytest.mark.parametrize("tight", [False, True])
def test_curvature_leads_back_to_the_line(tight: bool) -> None:
    tracker = Tracker(Segment(LINE))
    left_of_it = np.array([1.0, 0.2, 0.0])
    tracker.update(left_of_it)
    kappa, bearing = curvature(tracker, left_of_it, 0.5, S, tight)
    assert kappa < 0.0 and bearing < 0.0
    on_it = np.array([1.0, 0.0, 0.0])
    assert curvature(tracker, on_it, 0.5, S, tight) == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize(("speed", "reach"), [(0.2, 0.3), (0.7, 0.3), (1.2, 0.48)])
def test_a_path_that_is_followed_closely_is_looked_at_farther_ahead_only_where_it_is_fast(
    speed: float, reach: float
) -> None:
    x = np.linspace(0.0, 5.0, 101)
    tracker = Tracker(Segment(np.column_stack([x, np.zeros(101), np.zeros(101)])))
    _, bearing = curvature(tracker, np.array([0.0, 0.01, 0.0]), speed, S, True)
    assert 0.01 / abs(math.sin(bearing)) == pytest.approx(reach, abs=0.05)


def test_curvature_backward_is_that_of_the_arc_in_the_direction_of_travel() -> None:
    tracker = Tracker(Segment(BACKWARD, backward=True))
    pose = np.array([-1.0, 0.2, 0.0])
    tracker.update(pose)
    kappa, bearing = curvature(tracker, pose, -0.2, S, False)
    assert kappa > 0.0 and abs(bearing) < 1.0  # the line is to the left of one who drives along -x


@given(st.floats(-math.pi, math.pi).filter(lambda e: abs(e) > 1e-6))
def test_a_turn_can_end_at_rest_and_never_stalls(error: float) -> None:
    rate = turn_rate(error, 1.2)
    assert math.copysign(1.0, rate) == math.copysign(1.0, error)
    assert SLOWEST_TURN <= abs(rate) <= 1.2
    assert rate * rate <= 2.0 * 1.0 * abs(error) + SLOWEST_TURN**2


@given(st.floats(-1, 20), st.floats(0.1, 2.0), st.floats(0.0, 0.3))
def test_an_approach_can_stop_in_what_is_left(left: float, decel: float, lag: float) -> None:
    speed = approach_speed(left, decel, lag)
    assert speed >= CREEP
    if speed > CREEP:
        assert speed * lag + speed * speed / (2.0 * decel) <= left + 1e-9


def test_speed_falls_with_curvature_and_with_less_clearance() -> None:
    assert regulated_speed(0.0, 1.0, 1.2, S) == 1.2
    assert regulated_speed(0.0, 1.0, 0.4, S) == 0.4
    bend = regulated_speed(2.0, 1.0, 1.2, S)
    assert bend * bend * 2.0 <= S.max_lateral_acc + 1e-9 and bend * 2.0 <= S.control.max_angular_velocity
    assert regulated_speed(0.0, 0.0, 1.2, S) == pytest.approx(S.min_clearance_velocity)
