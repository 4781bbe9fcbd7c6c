"""One measurement a period is answered, also where their stamps jitter about the ends of periods."""

from __future__ import annotations

import itertools
import random

import pytest

from rackhand.runtime.periods import Periods

US = 1_000
PERIOD = 4_000 * US


def ticks(stamps: list[int]) -> list[int]:
    periods = Periods(PERIOD)
    return [stamp for stamp in stamps if periods.due(stamp) == "tick"]


@pytest.mark.parametrize("step", [500, 1_000, 2_000, 4_000])
def test_exact_stamps_are_answered_at_the_begin_of_each_period(step: int) -> None:
    stamps = [k * step * US for k in range(1, 200)]
    begins = [stamp for stamp in stamps[1:] if stamp % PERIOD == 0]
    assert ticks(stamps) == sorted({stamps[0], *begins})


@pytest.mark.parametrize("step", [1_000, 2_000, 4_000])
@pytest.mark.parametrize("phase", range(0, 4_000, 250))
def test_stamps_that_jitter_are_answered_at_the_same_rate(step: int, phase: int) -> None:
    """By a seventh of their gap: some just before the end of a period, some just after it."""
    draw = random.Random(phase)
    stamps = [(40_000 + phase + k * step + draw.randint(-step // 7, step // 7)) * US for k in range(2_000)]
    answered = ticks(stamps)
    gaps = [later - former for former, later in itertools.pairwise(answered)]
    assert max(gaps) <= 1.5 * PERIOD, "none is missed"
    assert max(abs(gap - PERIOD) for gap in gaps[10:]) <= 2 * step * US // 7
    assert len(answered) == pytest.approx(2_000 * step * US / PERIOD, abs=2)


@pytest.mark.parametrize("step", [3_990, 4_010])
def test_a_driver_whose_clock_is_not_quite_ours_is_followed(step: int) -> None:
    stamps = [k * step * US + 1 for k in range(2_000)]
    assert ticks(stamps) == stamps


def test_after_a_gap_it_goes_on_with_the_newest_measurement() -> None:
    late = 10 * PERIOD + 1_000 * US
    stamps = [0, PERIOD, late, late + 1_000 * US, 11 * PERIOD, 12 * PERIOD]
    assert ticks(stamps) == [0, PERIOD, late, 11 * PERIOD, 12 * PERIOD]


@pytest.mark.parametrize("lost", [1, 2, 3, 7, 20])
def test_after_a_gap_the_begins_of_periods_are_answered_as_before(lost: int) -> None:
    """Of a driver with two measurements a period, an odd number of which may be lost."""
    half = PERIOD // 2
    stamps = [k * half for k in range(200) if not 40 <= k < 40 + lost]
    first = (40 + lost) * half
    assert ticks(stamps) == sorted({first, *(stamp for stamp in stamps if stamp % PERIOD == 0)})


@pytest.mark.parametrize("seen", [0.95, 0.8, 0.6])
def test_measurements_that_are_not_seen_do_not_change_which_ones_are_answered(seen: float) -> None:
    """A busy service sees only the newest of those that have come."""
    draw = random.Random(1)
    stamps = [k * PERIOD // 2 for k in range(5_000) if draw.random() < seen]
    assert {stamp for stamp in stamps[1:] if stamp % PERIOD == 0} <= set(ticks(stamps))
