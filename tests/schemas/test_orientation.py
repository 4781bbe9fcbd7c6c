"""Orientations at the singularities of their forms, and the two signs of a quaternion."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rackhand.schemas.orientation import CardanForm, EulerForm, Matrix3, Orientation, Representation

EXACT = 5e-15  # of an element of a rotation matrix
OFF = [sign * size for size in (0.0, 1e-16, 1e-12, 3e-10, 1e-9, 3e-9, 1e-8, 1e-7, 1e-4) for sign in (1, -1)]
OUTER = [(0.0, 0.0), (0.4, -1.1), (-2.9, 3.0), (math.pi, -math.pi / 2)]


def written_and_read(rotation: Matrix3, form: Representation) -> Matrix3:
    text = Orientation.of(rotation, form).model_dump_json()
    return Orientation.model_validate_json(text).rotation()


@pytest.mark.parametrize("off", OFF)
def test_every_form_keeps_a_rotation_at_the_singularities_of_cardan_and_euler_angles(off: float) -> None:
    middles = [(CardanForm, sign * math.pi / 2) for sign in (1, -1)] + [(EulerForm, 0.0), (EulerForm, math.pi)]
    for (form, middle), (one, other) in product(middles, OUTER):
        angles = (one, middle + off, other)
        names = ("x", "y", "z") if form is CardanForm else ("z1", "x", "z2")
        rotation = form(**dict(zip(names, angles, strict=True))).matrix()
        for written in Representation:
            assert np.abs(written_and_read(rotation, written) - rotation).max() < EXACT, (form, angles, written)


@pytest.mark.parametrize(
    "angle", [0.0, 1e-16, 1e-9, 1e-4, math.pi - 1e-9, math.pi, math.pi + 1e-9, 2 * math.pi, -math.pi]
)
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.0, -0.8), (-1.0, 0.0, 0.0)])
def test_turns_of_nothing_and_of_half_a_turn_are_kept(angle: float, axis: tuple[float, float, float]) -> None:
    given_ = Orientation.model_validate({"AngleAxis": {"Angle": angle, "Axis": axis}}).rotation()
    for form in Representation:
        assert np.abs(written_and_read(given_, form) - given_).max() < EXACT


@settings(max_examples=200, deadline=None)
@given(st.tuples(*[st.floats(-7, 7)] * 3), st.sampled_from(Representation))
def test_every_rotation_is_kept_by_every_form(angles: tuple[float, float, float], form: Representation) -> None:
    rotation = CardanForm(x=angles[0], y=angles[1], z=angles[2]).matrix()
    assert np.abs(written_and_read(rotation, form) - rotation).max() < 4 * EXACT


@settings(max_examples=100, deadline=None)
@given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 0.1))
def test_a_quaternion_and_its_negative_are_the_same_rotation(q: tuple[float, ...]) -> None:
    unit = [value / math.hypot(*q) for value in q]
    one, other = (
        Orientation.model_validate({"Quaternion": dict(zip("WXYZ", [sign * value for value in unit], strict=True))})
        for sign in (1, -1)
    )
    assert np.array_equal(one.rotation(), other.rotation())
    assert Orientation.of(one.rotation()) == Orientation.of(other.rotation())
