"""What the control loops lose by those who watch: the page in a browser and the live view, on the same machine."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from benchmarks.report import Report
from benchmarks.viewer import Work, processors, viewer
from rackhand.bus import Bus, Inbox, Sample
from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.service import CELL, ServiceId
from rackhand.schemas.topics import Topic
from rackhand.testing import Cell, Judge
from tests.gateway.browser import browser

PAIRS, SEGMENT = 6, 8.0  # each with and without; seconds of wall time of either
DEPTH = 100_000  # commands that wait to be counted
LATE = 1.5  # periods since the state that was answered before: the controller's own limit


@dataclass(frozen=True)
class Loop:
    """A control loop, by the commands that it sends: each names the state that it answers."""

    service: str
    topic: Topic[Any]
    robot: str

    @property
    def period_ns(self) -> int:
        return round(NANOSECONDS / self.topic.rate)


LOOPS = (Loop("planner", topics.COMMAND, "amr1"), Loop("controller", topics.ARM_COMMAND, "arm1"))


@dataclass(frozen=True)
class Counted:
    """Of one loop in one segment. ``worst``: ms that the latest of its ticks came after its period."""

    ticks: int
    late: int
    worst: float


@dataclass(frozen=True)
class Segment:
    """``busy`` and ``stolen``: shares of the processors' time, of all processes and of the machine's host."""

    loops: dict[str, Counted]
    busy: float
    stolen: float


def run() -> Report:
    without, with_both = measured()
    rows = [_row(loop, segments, name) for loop in LOOPS for name, segments in _named(without, with_both)]
    return Report(
        "Late ticks with page and live view",
        "python -m benchmarks watchers",
        (
            "loop",
            "watched by",
            "ticks",
            "late a minute",
            "late in each segment",
            "worst lateness ms",
            "processors busy",
        ),
        rows,
        f"World `warehouse` at real time, robot and arm at work. {PAIRS} pairs of segments of {SEGMENT:.0f} s without "
        "and with the page in a headless Chromium and the live view beside it, all on this machine, in one cell, in "
        f"turns: off, on, on, off. A tick is late if the state that it answers is more than {LATE} periods after the "
        "one that was answered before it; periods are "
        f"{', '.join(_period(loop) for loop in LOOPS)}. The noise is how far "
        "the segments of a row differ. Busy is the share of all processors' time, programs of others included; the "
        f"machine's host took {_stolen(without, with_both)} of it at most.",
    )


def _named(without: list[Segment], with_both: list[Segment]) -> tuple[tuple[str, list[Segment]], ...]:
    return ("nobody", without), ("page and live view", with_both)


def _row(loop: Loop, segments: list[Segment], watched_by: str) -> tuple[str, ...]:
    counted = [segment.loops[loop.service] for segment in segments]
    ticks, late = sum(one.ticks for one in counted), sum(one.late for one in counted)
    minutes = ticks * loop.period_ns / NANOSECONDS / 60.0
    return (
        loop.service,
        watched_by,
        str(ticks),
        f"{late / minutes:.1f}",
        ", ".join(str(one.late) for one in counted),
        f"{max(one.worst for one in counted):.1f}",
        f"{sum(segment.busy for segment in segments) / len(segments):.0%}",
    )


def _period(loop: Loop) -> str:
    return f"{1000 / loop.topic.rate:.0f} ms ({loop.service})"


def _stolen(*kinds: list[Segment]) -> str:
    return f"{max(segment.stolen for segments in kinds for segment in segments):.1%}"


def measured() -> tuple[list[Segment], list[Segment]]:
    """The segments without and with watchers, of one cell."""
    without: list[Segment] = []
    with_both: list[Segment] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        Cell(Path(folder), lockstep=False) as cell,
        Judge(cell.bus) as judge,
        Bus(ServiceId("bench", CELL), cell.bus_config()) as bus,
    ):
        work = Work(cell, judge)
        work.for_wall_seconds(SEGMENT)  # what is compiled or learnt at first is in neither
        for number, watched in enumerate((PAIRS * (False, True, True, False))[: 2 * PAIRS], 1):
            with watchers(cell, bus) if watched else nullcontext():
                segment = _segment(work, bus)
            (with_both if watched else without).append(segment)
            late = ", ".join(f"{name} {one.late} late" for name, one in segment.loops.items())
            print(f"  {number}/{2 * PAIRS} {'watched' if watched else 'alone'}: {late}", file=sys.stderr, flush=True)
        work.end()
    return without, with_both


@contextmanager
def watchers(cell: Cell, bus: Bus) -> Iterator[None]:
    """The live view, and the page open in a browser, which draws it as on a screen."""
    with ExitStack() as opened:
        opened.enter_context(viewer(cell, bus))
        page = opened.enter_context(browser()).new_page(viewport={"width": 1280, "height": 800})
        page.goto(cell.http + "/")
        page.locator("#pose", has_text="m ·").wait_for()
        yield


def _segment(work: Work, bus: Bus) -> Segment:
    inboxes = {loop: bus.inbox().subscribe(loop.topic, loop.robot, depth=DEPTH) for loop in LOOPS}
    before = processors()
    work.for_wall_seconds(SEGMENT)
    stolen, idle, whole = processors() - before
    loops = {loop.service: counted(loop, _answered(inbox)) for loop, inbox in inboxes.items()}
    return Segment(loops, 1.0 - idle / whole, stolen / whole)


def _answered(inbox: Inbox) -> list[int]:
    """The states that were answered, in ns; all that have come so far."""
    stamps = []
    while isinstance(event := inbox.get(timeout=0.0), Sample):
        stamps.append(event.message.answers)
    assert not inbox.dropped, f"{inbox.dropped} commands were not counted"
    inbox.close()
    return stamps


def counted(loop: Loop, stamps: list[int]) -> Counted:
    gaps = [later - before for before, later in pairwise(stamps)]
    late = sum(gap > LATE * loop.period_ns for gap in gaps)
    return Counted(len(gaps), late, (max(gaps) - loop.period_ns) / 1e6)
