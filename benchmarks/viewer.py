"""What a cell loses by the live view."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import Report
from rackhand.bus import Bus, BusError, Inbox, Presence, Sample
from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.moves import TERMINAL
from rackhand.schemas.service import CELL, ServiceId
from rackhand.services.launch.child import GUARD
from rackhand.testing import Cell, Judge
from rackhand.testing.ports import free_port
from tests.scheduling import real_time_is_granted
from tests.system.driving import Driver, standard

GOALS = ((9.0, 7.3), (2.5, 7.3))
MEMORY = "16MB"
SPEED_PAIRS, SPEED_SEGMENT = 25, 8.0  # each with and without; seconds of wall time of either
LATE_PAIRS, LATE_SEGMENT = 12, 20.0  # late ticks are few: so they take longer
DISTURBED = 0.005  # of the processors' time, taken by the machine's host: then ticks are late whatever we do
TICKS = 60.0 * topics.ARM_COMMAND.rate  # of the controller, a minute at real time
RESAMPLINGS = 10_000
PATIENCE = 60.0


def run() -> Report:
    speeds = compared("max", speed_of, SPEED_PAIRS, SPEED_SEGMENT)
    late = compared("1", late_ticks_of, LATE_PAIRS, LATE_SEGMENT) if real_time_is_granted() else []
    plain = compared("1", late_ticks_of, LATE_PAIRS, LATE_SEGMENT, in_real_time=False)
    rows = [
        _row("speed of the cell at `--speed max`, x real time", speeds, "{:.2f}"),
        _row("ticks of the controller in time, at real time", [_in_time(pair) for pair in late], "{:.3%}"),
        *_late_rows("late ticks a minute", late),
        *_late_rows("late ticks a minute, controller not in real time", plain),
    ]
    return Report(
        "What the live view costs",
        "python -m benchmarks viewer",
        ("what", "without", "with", "ratio"),
        rows,
        f"World `warehouse`, robot and arm at work. Speed: {SPEED_PAIRS} pairs of segments of {SPEED_SEGMENT:.0f} s "
        f"without and with the viewer, in one cell; ticks: {LATE_PAIRS} of {LATE_SEGMENT:.0f} s, {TICKS:.0f} ticks a "
        "minute. Means of each, their ratio, and where that lies in 95 % of resamplings of the pairs. Undisturbed are "
        f"pairs in which the machine's host took less than {DISTURBED:.1%} of the processors' time (steal, see "
        "proc(5)). A segment with the viewer begins when it is there. The controller's loop runs in real time but in "
        "the last rows.",
    )


def _late_rows(what: str, late: Sequence[Pair]) -> list[tuple[str, ...]]:
    calm = [pair for pair in late if pair.stolen < DISTURBED]
    all_of_them = _row(f"{what}, {len(late)} pairs", late, "{:.1f}")
    return [all_of_them, _row(f"… of them {len(calm)} undisturbed", calm, "{:.1f}")]


def _row(what: str, pairs: Sequence[Pair], told: str) -> tuple[str, ...]:
    if not pairs:
        return what, "-", "-", "-"
    off, on = np.array([pair.off for pair in pairs]), np.array([pair.on for pair in pairs])
    means = what, told.format(off.mean()), told.format(on.mean())
    if not off.any():
        return *means, "-"
    drawn = np.random.default_rng(0).integers(len(pairs), size=(RESAMPLINGS, len(pairs)))
    with np.errstate(divide="ignore", invalid="ignore"):  # all that was drawn may be without
        low, high = np.nanpercentile(on[drawn].sum(axis=1) / off[drawn].sum(axis=1), (2.5, 97.5), method="nearest")
    return *means, f"{on.mean() / off.mean():.3f} ({low:.3f} to {high:.3f})"


def _in_time(late: Pair) -> Pair:
    """The share of all ticks."""
    return Pair(1 - late.off / TICKS, 1 - late.on / TICKS, late.stolen)


# -- with and without --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pair:
    """A value of a segment without the viewer, and of one beside it with it. ``stolen``: the share of the processors'
    time that the machine's host took in the worse of them.
    """

    off: float
    on: float
    stolen: float


def compared(
    speed: str, measure: Callable[[Work, Bus, float], float], count: int, segment: float, in_real_time: bool = True
) -> list[Pair]:
    """The pairs of one cell; ``segment`` in seconds of wall time. ``in_real_time``: False takes it from the controller.

    What drifts is in both halves of them, in turns: off, on, on, off …
    """
    pairs = []
    with (
        tempfile.TemporaryDirectory() as folder,
        Cell(Path(folder), "--speed", speed, lockstep=False) as cell,
        Judge(cell.bus) as judge,
        Bus(ServiceId("bench", CELL), cell.bus_config()) as bus,
    ):
        work = Work(cell, judge)
        work.for_wall_seconds(segment)  # what is compiled or learnt at first is in neither
        if not in_real_time:
            os.sched_setscheduler(cell.pid("controller"), os.SCHED_OTHER, os.sched_param(0))  # its slices stay short

        def unseen() -> tuple[float, float]:
            before = processors()
            value = measure(work, bus, segment)
            stolen, _, whole = processors() - before
            return value, stolen / whole

        def seen() -> tuple[float, float]:
            with viewer(cell, bus):
                return unseen()

        for number in range(count):
            if number % 2 == 0:
                off, on = unseen(), seen()
            else:
                on, off = seen(), unseen()
            pair = Pair(off[0], on[0], max(off[1], on[1]))
            pairs.append(pair)
            told = f"{pair.off:.2f} without, {pair.on:.2f} with, {pair.stolen:.1%} stolen"
            print(f"  speed {speed}: {told}", file=sys.stderr, flush=True)
        work.end()
    return pairs


def processors() -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Of the processors' time since the machine began: what the host has taken, what nobody used, and all of it."""
    first = Path("/proc/stat").read_text().splitlines()[0]
    spent = [int(value) for value in first.split()[1:9]]  # what guests used is in the first already
    return np.array([spent[7], spent[3] + spent[4], sum(spent)])


def speed_of(work: Work, _bus: Bus, segment: float) -> float:
    """Simulated seconds a second."""
    begun, stamp = time.perf_counter(), work.judge.now()
    work.for_wall_seconds(segment)
    return (work.judge.now() - stamp) / (time.perf_counter() - begun)


def late_ticks_of(work: Work, bus: Bus, segment: float) -> float:
    """A minute of wall time."""
    inbox = bus.inbox().subscribe(topics.MOTION_DIAGNOSTICS, "arm1", depth=1)
    before, begun = _late(inbox), time.perf_counter()
    work.for_wall_seconds(segment)
    _late(inbox)  # the one that has waited since
    counted = _late(inbox) - before
    inbox.close()
    return counted * 60.0 / (time.perf_counter() - begun)


def _late(inbox: Inbox) -> int:
    event = inbox.get(timeout=PATIENCE)
    assert isinstance(event, Sample), "the controller tells nothing"
    return int(event.message.late_ticks)


@contextmanager
def viewer(cell: Cell, bus: Bus, memory: str = MEMORY) -> Iterator[int]:
    """The viewer on a cell that runs, in a session of its own as the supervisor would start it; its pid."""
    presence = bus.inbox().watch_services()
    guarded = [sys.executable, str(GUARD), str(os.getpid())]  # a benchmark that is killed leaves no viewer behind
    command = [*guarded, sys.executable, "-m", "rackhand.services.viewer", "--memory", memory]
    command += ["--web-port", str(free_port()), "--data-port", str(free_port())]
    environment = {**os.environ, "RACKHAND_BUS_CONNECT": cell.bus}
    process = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL, process_group=0)
    try:
        while (event := presence.get(timeout=PATIENCE)) != Presence(ServiceId("viewer", CELL), alive=True):
            assert event is not None, "no viewer came"
        yield process.pid
    finally:
        presence.close()
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=PATIENCE)


# -- work --------------------------------------------------------------------------------------------------------------


class Work:
    """Keeps robot and arm busy."""

    def __init__(self, cell: Cell, judge: Judge) -> None:
        self.judge = judge
        self._driver = Driver(cell, judge)
        self._driver.wait(lambda world: len(world.participants) == 2, "both have joined")
        self._moves, self._move = 0, 0
        self._home = self._arm()["jointPositions"]["value"]

    def go_on(self) -> None:
        """The next move where the last has ended, the next path where none runs."""
        if not self._move or self._driver.move(self._move)["state"] in TERMINAL:
            self._move = self._driver.post(standard(*GOALS[self._moves % 2]))
            self._moves += 1
        if not self._arm()["isTrajectoryRunning"]["value"]:
            path = 20 * [[q + 0.5 for q in self._home], self._home]
            command = {"command": "appendPath", "priority": 10, "type": "joints", "data": path}
            self._driver.request("POST", "/motion/arm1/command", command)

    def for_wall_seconds(self, seconds: float) -> None:
        end = time.perf_counter() + seconds
        while time.perf_counter() < end:
            self.go_on()
            time.sleep(0.5)

    def until_simulated(self, seconds: float) -> None:
        """On a machine that is short of time an answer may be missing: the next round asks again."""
        while True:
            with suppress(BusError, AssertionError):
                self.go_on()
                if self.judge.inspect().clock.stamp >= seconds * NANOSECONDS:
                    return
            time.sleep(0.5)

    def end(self) -> None:
        self._driver.close()

    def _arm(self) -> dict[str, Any]:
        return dict(self._driver.request("GET", "/motion/arm1/status"))
