"""The trace of a move: bounded, and it counts what held it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.schemas.base import Twist2
from rackhand.services.planner.behaviors.base import Status
from rackhand.services.planner.moves.evidence import MOST_HOLDS, ROWS, MoveTrace, SpeedLimit, Tick

STEP = 40_000_000
STILL = Twist2(linear=0.0, angular=0.0)


def tick(k: int, speed: float = 0.0, **changes: Any) -> Tick:
    twist = Twist2(linear=speed, angular=0.0)
    fields: dict[str, Any] = {"held_by": None, "status": Status(), "pose": np.array([0.01 * k, 0.0, 0.0])}
    return Tick(stamp=k * STEP, measured=twist, commanded=twist, **(fields | changes))


def traced(*ticks: Tick) -> MoveTrace:
    trace = MoveTrace(0)
    for one in ticks:
        trace.note(one)
    return trace


def test_the_trace_holds_the_last_ten_seconds_whatever_the_move_lasts() -> None:
    rows = traced(*(tick(k, 0.25) for k in range(1000))).rows()
    assert len(rows) == ROWS
    assert rows[0, 0] == pytest.approx(-10.0) and rows[-1, 0] == 0.0
    assert rows[-1, 1] == pytest.approx(9.99)
    assert rows[:, 4] == pytest.approx(0.25)


def test_what_was_driven_is_the_integral_of_the_speed() -> None:
    assert traced(*(tick(k, 0.5) for k in range(101))).driven == pytest.approx(2.0)


def test_each_cause_of_a_hold_is_counted_apart_and_its_numbers_do_not_matter() -> None:
    waits = [tick(k, held_by=f"no position for {0.04 * k:.2f} s") for k in range(26)]
    pause = [tick(k, held_by="the move is paused on request") for k in range(26, 76)]
    held = traced(*waits, *pause).held()
    assert [(one.by[:11], one.seconds) for one in held] == [("the move is", 2.0), ("no position", 1.0)]


def test_a_blocked_chassis_at_rest_is_held_by_an_obstacle_and_one_that_creeps_on_is_not() -> None:
    blocked = Status(viewport_blocked=True)
    assert traced(*(tick(k, status=blocked) for k in range(26))).held()[0].by == "an obstacle"
    assert traced(*(tick(k, 0.2, status=blocked) for k in range(26))).held() == ()


def test_a_speed_limit_counts_while_it_is_driven_at() -> None:
    limit = SpeedLimit(0.3, "a slow zone of 0.30 m/s")
    held = traced(*(tick(k, 0.3 if k < 51 else 0.1, limit=limit) for k in range(100))).held()
    assert [(one.by, one.seconds) for one in held] == [("a slow zone of 0.30 m/s", 2.0)]


def test_of_many_causes_the_last_are_one() -> None:
    held = traced(*(tick(k, held_by="x" * (k + 1)) for k in range(30))).held()
    assert len(held) == MOST_HOLDS + 1
    assert next(one for one in held if one.by == "other causes").seconds == pytest.approx(18 * 0.04)


def test_a_clock_that_begins_anew_does_not_count_backward() -> None:
    trace = traced(tick(100, 0.5), tick(3, 0.5))
    assert trace.seconds == 4.0 and trace.driven >= 0.0


def test_only_the_paths_of_the_last_ten_seconds_are_kept() -> None:
    paths = [Status(plans=n, path=np.full((3, 3), float(n))) for n in range(1, 5)]
    trace = traced(tick(0, status=paths[0]), tick(100, status=paths[1]), tick(400, status=paths[2]), tick(401))
    assert [path.poses[0, 0] for path in trace.paths()] == [2.0, 3.0], "the one that was followed 10 s ago too"
