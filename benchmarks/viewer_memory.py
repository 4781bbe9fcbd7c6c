"""Memory of the live view over an hour of simulation."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from benchmarks.report import Report
from benchmarks.viewer import MEMORY, Work, viewer
from rackhand.bus import Bus
from rackhand.schemas.service import CELL, ServiceId
from rackhand.testing import Cell, Judge

HOUR, READINGS = 3600.0, 12  # of simulation


def run() -> Report:
    return Report(
        "Memory of the live view",
        "python -m benchmarks viewer_memory",
        ("after so much simulation", "viewer + server", "ratio to the first"),
        memory_rows(),
        "World `warehouse` at `--speed max`, robot and arm at work. Resident memory of the viewer and of Rerun's "
        f"server, which keeps {MEMORY} for viewers that come late: full after some minutes, so that it shows whether "
        "memory is flat.",
    )


def memory_rows() -> list[tuple[str, ...]]:
    """Resident memory while an hour of simulation passes."""
    rows = []
    with (
        tempfile.TemporaryDirectory() as folder,
        Cell(Path(folder), "--speed", "max", lockstep=False) as cell,
        Judge(cell.bus) as judge,
        Bus(ServiceId("bench", CELL), cell.bus_config()) as bus,
        viewer(cell, bus) as pid,
    ):
        work = Work(cell, judge)
        first = 0.0
        for reading in range(1, READINGS + 1):
            work.until_simulated(reading * HOUR / READINGS)
            own, server = resident(pid), sum(map(resident, children(pid)))
            first = first or own + server
            minutes = reading * HOUR / READINGS / 60
            told = f"{own:.0f} + {server:.0f} MB"
            print(f"  after {minutes:.0f} min of simulation: {told}", file=sys.stderr, flush=True)
            rows.append((f"{minutes:.0f} min", told, f"{(own + server) / first:.2f}"))
        work.end()
    return rows


def resident(pid: int) -> float:
    """MB."""
    fields = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return int(fields["VmRSS"].split()[0]) / 1024


def children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
