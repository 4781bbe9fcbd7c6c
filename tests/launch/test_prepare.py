"""What ``rackhand prepare`` makes of the lines and the ends of warm-ups; the warm-ups themselves are small programs."""

from __future__ import annotations

import importlib
import sys

import pytest

from rackhand.services.launch.prepare import PARTS, CannotPrepare, Part, prepare


def part(name: str, code: str) -> Part:
    return Part(name, (sys.executable, "-I", "-S", "-c", code))


def test_progress_of_every_part_is_shown() -> None:
    shown: list[tuple[str, int, int]] = []
    parts = [part(name, "print(0, 3); print('a warning'); print(3, 3)") for name in ("one", "two", "three")]
    prepare(parts, lambda name, ready, functions: shown.append((name, ready, functions)))
    expected = [(f"compiling {name}", ready, 3) for name in ("one", "two", "three") for ready in (0, 3)]
    assert sorted(shown) == sorted(expected)


def test_an_error_shows_what_the_warm_up_said_and_ends_the_others() -> None:
    stays = part("sim", "import signal; signal.pause()")
    broken = part("planner", "print('there is no compiler'); raise SystemExit(3)")
    with pytest.raises(CannotPrepare, match="the warm-up of planner ended with exit code 3:\nthere is no compiler"):
        prepare([stays, broken])


def test_every_part_is_a_module_that_can_be_run() -> None:
    assert {part.name for part in PARTS} == {"planner", "controller", "sim"}
    for each in PARTS:
        assert callable(importlib.import_module(each.command[-1]).warm_up)
