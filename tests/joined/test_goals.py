"""Six of the twenty random goals of ``benchmarks/goals.py``: all reached, nothing touched."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.goals import chosen_goals, drive_to, warehouse

PARTS = ((0, 2, 4), (1, 3, 5))  # each a test of its own, from the start


@pytest.mark.parametrize("numbers", PARTS)
def test_the_goals_are_reached_and_nothing_is_touched(numbers: tuple[int, ...], tmp_path: Path) -> None:
    with warehouse(tmp_path) as world:
        goals = chosen_goals(world)
        rows = [drive_to(world, goals[number]) for number in numbers]
        assert {row.state for row in rows} == {"succeeded"}, rows
        assert max(row.off for row in rows) <= 0.05, rows
        assert max(row.turned for row in rows) <= 2.0, rows
        assert world.inspect().contacts == ()
