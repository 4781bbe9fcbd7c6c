"""A stop from any state: at rest within the limits, and gently where there is room."""

from __future__ import annotations

import numpy as np

from rackhand.services.controller.motion.braking import braking
from rackhand.services.controller.motion.profile import hardware_limits
from rackhand.services.controller.trajectory.stream import Sample
from tests.controller.cell import UR5E

LIMITS = hardware_limits(UR5E)
STILL = np.zeros(6)


def moving(q: np.ndarray, dq: np.ndarray) -> Sample:
    return Sample(q, dq, STILL, None, 0.0, False)


def test_it_comes_to_rest_with_the_gentle_deceleration() -> None:
    dq, gentle = np.array([1.0, -0.5, 0.2, 0.0, 0.8, -1.0]), 0.3 * LIMITS.acceleration
    stop = braking(2.0, moving(UR5E.home, dq), LIMITS, gentle)
    hard = braking(2.0, moving(UR5E.home, dq), LIMITS)
    assert hard.end < stop.end
    samples = [stop.at(t) for t in np.linspace(2.0, stop.end, 200)]
    assert all((np.abs(sample.ddq) <= gentle + 1e-9).all() for sample in samples)
    assert np.array_equal(samples[0].dq, dq) and np.abs(samples[-1].dq).max() < 1e-12
    assert np.allclose(samples[-1].q, stop.rest)


def test_close_to_a_limit_it_brakes_harder_and_stays_within() -> None:
    q, dq = UR5E.home.copy(), STILL.copy()
    q[0] = LIMITS.upper[0] - 0.05
    dq[0] = 0.95 * np.sqrt(2 * LIMITS.acceleration[0] * 0.05)
    gentle = 0.1 * LIMITS.acceleration
    overshoot = q[0] + dq[0] ** 2 / (2 * gentle[0])
    assert overshoot > LIMITS.upper[0], "the gentle stop would leave the range"
    stop = braking(0.0, moving(q, dq), LIMITS, gentle)
    assert LIMITS.outside(stop.rest) is None
