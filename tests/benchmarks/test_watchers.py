"""Late ticks are counted by the states that commands answer."""

from __future__ import annotations

from benchmarks.watchers import LOOPS, Counted, counted

PERIOD = 40_000_000  # ns, of the planner


def test_a_state_that_was_passed_over_is_a_late_tick() -> None:
    planner = LOOPS[0]
    assert planner.period_ns == PERIOD
    in_time = [number * PERIOD for number in range(6)]
    assert counted(planner, in_time) == Counted(ticks=5, late=0, worst=0.0)
    assert counted(planner, [0, PERIOD, 4 * PERIOD, 6 * PERIOD]) == Counted(ticks=3, late=2, worst=80.0)
