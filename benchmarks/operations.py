"""Requests of any kind in any order, over HTTP and WebSocket, to a gateway, a planner and a simulator of one process.

    python -m benchmarks operations --count 20000

Each run of 150 steps begins with a new world and an empty store; eleven of them are a series, which has a gateway of
its own. A series ends at its first fault: a status from 500 on, a request without an answer, an error of the planner,
or a contact; what led to it is written to a file, and the other series go on.
"""

from __future__ import annotations

import sys
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis.stateful import run_state_machine_as_test

from benchmarks.progress import say, update
from benchmarks.report import Report
from tests.gateway import harness
from tests.joined.operations import Operations
from tests.joined.served import Served, served_world

PATIENCE = 180.0  # s of wall time for an answer; only ever bounds a failure
STEPS = 150  # of one run
RUNS = 11  # of one gateway; the first one of hypothesis takes the simplest of all choices, again and again


class Watched(Operations):
    """Shows how far it is, and keeps what ended a run: of one that is not the same when it is repeated, as of a request
    that the load of the machine made late, hypothesis tells only that."""

    total = 0
    error = ""

    def teardown(self) -> None:
        if (error := sys.exception()) is not None:
            Watched.error = "".join(traceback.format_exception(error))
        super().teardown()
        update("requests", self.asked.total(), Watched.total)


@dataclass(frozen=True)
class Options:
    """``count``: of requests, at least. ``results``: the file that faults are written to."""

    count: int = 20_000
    results: Path = Path("operations-results.txt")


def run(options: Options | None = None) -> Report:
    chosen = options or Options()
    Operations.asked.clear()
    Watched.total, harness.PATIENCE = chosen.count, PATIENCE
    series = faults = 0
    begun = time.monotonic()
    while Operations.asked.total() < chosen.count:
        with tempfile.TemporaryDirectory() as folder, served_world("warehouse", Path(folder)) as served:
            update("requests", Operations.asked.total(), chosen.count)
            series += 1
            if (text := fault_of(series, served)) is not None:
                faults += 1
                say(f"series {series}: {text.splitlines()[-1]}")
                with chosen.results.open("a") as file:
                    file.write(f"== series {series}\n{text}\n")
    return report(Operations.asked, series, faults, time.monotonic() - begun)


def fault_of(number: int, served: Served) -> str | None:
    """The first fault of the series of that number, with its traceback and its steps; None without."""
    Operations.served, Watched.error = served, ""
    chosen = settings(
        max_examples=RUNS,
        stateful_step_count=STEPS,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    machine = seed(number)(type("Series", (Watched,), {}))
    try:
        run_state_machine_as_test(machine, settings=chosen)
    except Exception as error:
        notes = "\n".join(getattr(error, "__notes__", ()))
        return f"{Watched.error}\n{traceback.format_exc()}\n{notes}\n{_line(Watched.error) or _line(str(error))}"
    return None


def _line(text: str) -> str:
    """The last one with something in it."""
    return next((line[:500] for line in reversed(text.splitlines()) if line.strip()), "")


def report(asked: Counter[str], series: int, faults: int, wall: float) -> Report:
    rows = [(name, str(count)) for name, count in sorted(asked.items())]
    return Report(
        "Requests in any order",
        f"python -m benchmarks operations --count {asked.total()}",
        ("answer", "requests"),
        [*rows, ("all", str(asked.total())), ("series", str(series)), ("series that ended with a fault", str(faults))],
        "Moves of all types, cancelled, paused and explained, the jack, control modes, remote driving, the emergency "
        "stop, settings, overlays, maps, faults of the world, WebSocket subscriptions and reads, in random order. A "
        "fault is a status from 500 on, a request without an answer, a move that failed for an error of the planner, "
        f"or a contact of the robot by the ground truth. Wall time here: {wall / 60:.0f} min.",
    )
