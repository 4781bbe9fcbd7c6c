"""One convention for poses in the plane."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.schemas.planar import between, compose, transform, wrap, yaw_quaternion

ANGLES = st.floats(-1e4, 1e4)
POSES = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-10, 10))


def matrix(pose: tuple[float, float, float]) -> np.ndarray:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


@given(ANGLES)
def test_wrap_is_the_same_angle_in_its_range(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@pytest.mark.parametrize("angle", [math.pi, -math.pi, 3 * math.pi, math.nextafter(math.pi, 4), 0.0])
def test_half_a_turn_is_positive(angle: float) -> None:
    assert wrap(angle) == (pytest.approx(math.pi) if angle else 0.0)


@given(POSES, POSES)
def test_compose_is_the_product_of_matrices(a: tuple[float, float, float], b: tuple[float, float, float]) -> None:
    product = matrix(a) @ matrix(b)
    assert matrix(compose(a, b)) == pytest.approx(product, abs=1e-9)
    assert transform(a, b[0], b[1]) == pytest.approx(tuple(product[:2, 2]), abs=1e-9)
    assert matrix(between(a, b)) == pytest.approx(np.linalg.inv(matrix(a)) @ matrix(b), abs=1e-9)


@given(POSES, POSES)
def test_between_undoes_compose(a: tuple[float, float, float], b: tuple[float, float, float]) -> None:
    x, y, yaw = between(a, compose(a, b))
    assert (x, y) == pytest.approx(b[:2], abs=1e-9)
    assert wrap(yaw - b[2]) == pytest.approx(0.0, abs=1e-9)


def test_arrays_and_tuples_alike() -> None:
    a, b = (1.0, 2.0, 0.5), (0.3, -0.2, 3.0)
    assert compose(np.array(a), np.array(b)) == compose(a, b)


@given(st.floats(-math.pi, math.pi))
def test_yaw_quaternion_turns_x_by_yaw(yaw: float) -> None:
    w, x, y, z = yaw_quaternion(yaw)
    assert (x, y) == (0.0, 0.0) and w * w + z * z == pytest.approx(1.0)
    assert (w * w - z * z, 2 * w * z) == pytest.approx((math.cos(yaw), math.sin(yaw)))
