"""Three of the twenty random goals of ``benchmarks/goals.py``: all reached, nothing touched."""

from __future__ import annotations

from pathlib import Path

from benchmarks.goals import chosen_goals, drive_to, warehouse

NUMBERS = (0, 2, 4)


def test_the_goals_are_reached_and_nothing_is_touched(tmp_path: Path) -> None:
    with warehouse(tmp_path) as world:
        goals = chosen_goals(world)
        rows = [drive_to(world, goals[number]) for number in NUMBERS]
        assert {row.state for row in rows} == {"succeeded"}, rows
        assert max(row.off for row in rows) <= 0.05, rows
        assert max(row.turned for row in rows) <= 2.0, rows
        assert world.inspect().contacts == ()
