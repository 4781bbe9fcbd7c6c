from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rackhand.services.controller.motion.ramp import AVERAGED, REMEMBERED, Ramp, Reference

DT = 0.004
A, J = np.array([7.5, 5.0, 20.0]), np.array([500.0, 300.0, 800.0])
vectors = st.lists(st.floats(-3, 3, allow_subnormal=False), min_size=3, max_size=3).map(np.array)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(vectors, st.integers(1, 60)), min_size=1, max_size=5))
def test_every_reference_is_reached_within_the_limits(references: list[tuple[np.ndarray, int]]) -> None:
    ramp = Ramp(3)
    last = ramp.velocity.copy()
    for target, ticks in [*references, (np.zeros(3), 1000)]:
        for _ in range(ticks):
            velocity = ramp.step(target, A, J, DT)
            assert (np.abs(velocity - last) <= A * DT * 1.01).all()
            last = velocity.copy()
    assert np.abs(ramp.velocity).max() < 1e-9


def test_from_rest_all_components_arrive_together_and_none_overshoots() -> None:
    ramp, target = Ramp(3), np.array([0.5, -0.2, 1.0])
    seen = np.array([ramp.step(target, A, J, DT) for _ in range(100)])
    share = seen / target
    assert np.ptp(share, axis=1).max() < 1e-9
    assert share.max() < 1 + 1e-9
    assert np.abs(seen[-1] - target).max() < 1e-9
    rises = np.abs(np.diff(np.diff(seen, axis=0), axis=0)) / DT**2
    assert (rises.max(axis=0) <= J * 1.2).all(), "but for what the last period rounds off"


def test_what_is_cut_goes_on_from_there_without_delay() -> None:
    ramp = Ramp(1)
    for _ in range(50):
        ramp.step(np.array([3.0]), A[:1], J[:1], DT)
        ramp.cut(np.minimum(ramp.velocity, 0.1))
    back = [float(ramp.step(np.array([-1.0]), A[:1], J[:1], DT)[0]) for _ in range(10)]
    assert back[-1] < 0.0


def followed(values: list[float]) -> np.ndarray:
    reference = Reference(1, DT)
    return np.array([float(reference.step(np.array([value]))[0]) for value in values])


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 3, allow_subnormal=False), st.integers(1, 30)), min_size=1, max_size=6))
def test_a_reference_that_changes_in_one_direction_is_not_delayed(steps: list[tuple[float, int]]) -> None:
    values = list(np.cumsum(np.concatenate([[size] + [0.0] * (ticks - 1) for size, ticks in steps])))
    assert np.allclose(followed(values), values, atol=1e-9)


@pytest.mark.parametrize("ticks", [1, 2, 3, 4, 6, 12])
@pytest.mark.parametrize(("low", "high"), [(-0.3, 0.3), (0.0, 0.2)])
def test_a_reference_that_alternates_is_followed_as_its_mean(ticks: int, low: float, high: float) -> None:
    values = [(high, low)[k // ticks % 2] for k in range(400)]
    seen = followed(values)[round(REMEMBERED / DT) :]
    assert np.abs(seen - 0.5 * (low + high)).max() < 0.13 * (high - low)
    assert abs(seen.mean() - 0.5 * (low + high)) < 0.02 * (high - low)


def test_after_it_has_alternated_a_constant_reference_is_reached() -> None:
    seen = followed([0.3 * (-1) ** k for k in range(100)] + [0.2] * 60)
    assert abs(seen[100 + round(AVERAGED / DT)] - 0.2) < 1e-12 and seen[-1] == 0.2
