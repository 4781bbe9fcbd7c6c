"""Efforts are means over the period of the states."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.services.sim.arm.efforts import Efforts

TORQUES = np.array([3.0, -8.0])


@pytest.mark.parametrize(("period", "mean"), [(1, 3.5), (2, 2.5), (3, 1.5), (9, 1.5)])
def test_they_are_the_mean_of_the_last_period_and_of_no_more_than_there_was(period: int, mean: float) -> None:
    efforts = Efforts(1, 2)
    efforts.period = period
    efforts.total += 1000.0  # before time began
    for first, second in ((-1.0, 0.0), (1.0, 2.0), (3.0, 4.0)):
        efforts.begin()
        efforts.total += first
        efforts.total += second
    assert efforts.mean(np.zeros(1)) == pytest.approx(mean)


def test_before_time_begins_they_are_the_torques() -> None:
    efforts = Efforts(2, 2)
    efforts.total += 1000.0
    assert efforts.mean(TORQUES).tolist() == TORQUES.tolist()
