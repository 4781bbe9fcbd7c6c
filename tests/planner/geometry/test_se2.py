from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.runtime.compiled import compiled
from rackhand.schemas import planar
from rackhand.schemas.base import Pose2
from rackhand.services.planner.geometry.se2 import between, compose, interpolate, pose, wrap

POSES = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-7, 7)).map(np.array)


@compiled
def _wrap_from_compiled(angle: float) -> float:
    return wrap(angle)


@given(st.floats(-1e3, 1e3))
def test_compiled_wrap_is_that_of_planar(angle: float) -> None:
    assert wrap(angle) == _wrap_from_compiled(angle) == planar.wrap(angle)


@given(POSES, POSES)
def test_between_and_compose_are_inverse(a: np.ndarray, b: np.ndarray) -> None:
    back = compose(a, between(a, b))
    assert back[:2] == pytest.approx(b[:2], abs=1e-9)
    assert wrap(back[2] - b[2]) == pytest.approx(0.0, abs=1e-9)


def test_interpolation_takes_the_shorter_arc() -> None:
    a, b = np.array([0.0, 0.0, 3.0]), np.array([2.0, 4.0, -3.0])
    halfway = interpolate(a, b, 0.5)
    assert halfway[:2] == pytest.approx([1.0, 2.0])
    assert abs(halfway[2]) == pytest.approx(math.pi)
    assert interpolate(a, b, 0.0) == pytest.approx(a) and interpolate(a, b, 1.0) == pytest.approx(b)


def test_pose_of_a_message() -> None:
    assert pose(Pose2(x=1.0, y=2.0, yaw=0.5)).tolist() == [1.0, 2.0, 0.5]
