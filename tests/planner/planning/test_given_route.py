"""Routes as text, and the legs made of them: what is malformed, how bends are rounded, which points are passed."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import wrap
from rackhand.services.planner.planning.given_route import ROUNDING, SHARPEST_ROUNDED, legs_of, parse_route
from rackhand.services.planner.planning.plan import SPACING
from tests.planner.plant import off_line

Points = list[tuple[float, float]]


def text(points: Points) -> str:
    return ", ".join(f"{x}, {y}" for x, y in points)


@pytest.mark.parametrize(
    ("given_text", "why"),
    [
        (None, "0 point(s), expected at least 2"),
        ("", "0 point(s), expected at least 2"),
        ("1, 2", "1 point(s), expected at least 2"),
        ("1, 2, 3", "3 numbers, expected an even count: x1, y1, x2, y2, …"),
        ("1, 2, 3,", "number 4 is '', expected a decimal number"),
        ("1, 2, x, 4", "number 3 is 'x', expected a decimal number"),
        ("1, 2, nan, 4", "number 3 is 'nan', expected a finite one"),
        ("1, 2, 1e400, 4", "number 3 is '1e400', expected a finite one"),
        ("1; 2; 3; 4", "number 1 is '1; 2; 3; 4', expected a decimal number"),
        ("1, 2, 1.001, 2, 1, 2.002", "3 points within 0.01 m of each other, expected at least 2 different ones"),
        ("0, 0, 6000, 0", "a route of 6000 m, expected at most 5000 m"),
        ("0, 0, 1e300, 0", f"a route of {1e300:.0f} m, expected at most 5000 m"),
    ],
)
def test_a_malformed_route_is_named(given_text: str | None, why: str) -> None:
    with pytest.raises(MoveFailed) as failed:
        parse_route(given_text)
    assert (failed.value.reason, failed.value.text) == (
        MoveFailReason.INVALID_TRACK_POINTS, f"route_coordinates: {why}",
    )  # fmt: skip


def test_spaces_and_exponents_are_read() -> None:
    route = parse_route(" 1,2 , -3.5e0,4e-1")
    assert route.points.tolist() == [[1.0, 2.0], [-3.5, 0.4]]


def test_repeated_points_are_one_corner_and_all_of_them_count() -> None:
    route = parse_route("0,0, 0,0, 2,0, 2,0.001, 2,3")
    assert route.corners.tolist() == [[0.0, 0.0], [2.0, 0.0], [2.0, 3.0]]
    assert route.passed.tolist() == [2, 4, 5]
    first, second = legs_of(route)
    assert (first.passed[0], first.passed[-1], second.passed[0], second.passed[-1]) == (2, 4, 4, 5)


def test_a_large_bend_ends_the_leg_and_a_small_one_is_rounded() -> None:
    square = legs_of(parse_route("0,0, 2,0, 2,2, 0,2"))
    assert [leg.rows[0].round(6).tolist() for leg in square] == [
        [0.0, 0.0, 0.0], [2.0, 0.0, round(math.pi / 2, 6)], [2.0, 2.0, round(math.pi, 6)],
    ]  # fmt: skip
    assert all(not leg.curvature.any() for leg in square)
    (bent,) = legs_of(parse_route("0,0, 3,0, 6,0.5"))
    assert bent.curvature.max() > 0.0 and bent.curvature.min() == 0.0, "to the left"
    assert bent.rows[-1, 2] == pytest.approx(math.atan2(0.5, 3.0))


def test_there_and_back_is_a_turn_by_180_degrees() -> None:
    there, back = legs_of(parse_route("0,0, 3,0, 0,0"))
    assert abs(wrap(back.rows[0, 2] - there.rows[-1, 2])) == pytest.approx(math.pi)


@given(
    st.lists(
        st.tuples(st.floats(0.02, 5.0), st.one_of(st.floats(-0.34, 0.34), st.floats(-3.1, 3.1))), min_size=1, max_size=8
    )
)
def test_legs_stay_on_the_route_and_are_smooth(sides: list[tuple[float, float]]) -> None:
    """Of any route: rows within the rounding of the given line, ``SPACING`` apart at most, no jump of heading."""
    points, heading = [np.zeros(2)], 0.0
    for length, turn in sides:
        heading += turn
        points.append(points[-1] + length * np.array([math.cos(heading), math.sin(heading)]))
    assume(all(math.dist(a, b) > 0.015 for a, b in itertools.combinations(points, 2)))
    route = parse_route(text([(float(x), float(y)) for x, y in points]))
    legs = legs_of(route)
    assert legs[0].rows[0, :2] == pytest.approx(points[0]) and legs[-1].rows[-1, :2] == pytest.approx(points[-1])
    assert legs[0].passed[0] == 1 and legs[-1].passed[-1] == len(points)
    for leg in legs:
        steps = np.hypot(*np.diff(leg.rows[:, :2], axis=0).T)
        assert steps.max() <= SPACING + 1e-9 and steps.min() > 0.0
        assert max(off_line(np.array(points), row) for row in leg.rows[:, :2]) <= ROUNDING + 1e-6
        turns = [abs(wrap(b - a)) for a, b in itertools.pairwise(leg.rows[:, 2])]
        assert max(turns, default=0.0) <= SHARPEST_ROUNDED / 2 + 1e-6
        assert (np.diff(leg.passed) >= 0).all()
    for before, after in itertools.pairwise(legs):
        assert before.rows[-1, :2] == pytest.approx(after.rows[0, :2])
        assert abs(wrap(after.rows[0, 2] - before.rows[-1, 2])) > SHARPEST_ROUNDED
