"""Positions that follow a torque: no bump in position or velocity, and nothing is left of them in the end."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.services.sim.arm.take_over import FARTHEST, TIME, TakeOver

PERIOD = 2_000_000
ACCELERATION = np.array([15.0, 20.0])


def added(stream: np.ndarray, ahead: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Positions (steps, 2) that are followed in place of ``stream``."""
    take_over = TakeOver(ACCELERATION)
    take_over.begin(PERIOD, stream[0], stream[0] + ahead, velocity)
    return np.array([take_over.added((i + 1) * PERIOD, values) + values for i, values in enumerate(stream)])


@pytest.mark.parametrize("faster", [0.0, 0.3, -0.8])
def test_it_goes_on_from_where_the_arm_is_with_its_velocity(faster: float) -> None:
    t = np.arange(300)[:, None] * PERIOD * 1e-9
    stream = np.array([0.5, -0.7]) * t
    velocity = np.array([0.5, -0.7]) + faster
    followed = added(stream, np.array([0.01, -0.02]), velocity)
    rates = np.diff(followed, axis=0) / (PERIOD * 1e-9)
    np.testing.assert_allclose(followed[0], stream[0] + [0.01, -0.02])
    np.testing.assert_allclose(rates[0], velocity, atol=0.02)
    steepest = np.abs(np.diff(rates, axis=0)).max(axis=0) / (PERIOD * 1e-9)
    assert (steepest <= 4 * abs(faster) / TIME + 6 * 0.02 / TIME**2 + 0.1).all()
    np.testing.assert_allclose(followed[-1], stream[-1], atol=1e-12)


def test_a_velocity_that_would_fade_beyond_the_limits_is_taken_over_in_part() -> None:
    followed = added(np.zeros((300, 2)), np.zeros(2), np.array([5.0, -5.0]))
    steepest = np.abs(np.diff(followed[1:], n=2, axis=0)).max(axis=0) / (PERIOD * 1e-9) ** 2
    assert (steepest <= ACCELERATION * 1.01).all() and (steepest > 0.9 * ACCELERATION).all()


def test_a_joint_that_is_commanded_elsewhere_goes_there() -> None:
    followed = added(np.zeros((10, 2)), np.array([1.1 * FARTHEST, 0.9 * FARTHEST]), np.array([1.0, 0.0]))
    assert followed[:, 0].tolist() == [0.0] * 10 and followed[1, 1] > 0.8 * FARTHEST
