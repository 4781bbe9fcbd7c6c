"""How soon an arm's driver is answered over the bus, how often too late, and how soon a request moves the arm.

    python -m benchmarks motion

Twice at each rate: with the driver in this process, a perfect arm that publishes its state by the absolute clock and
notes when each answer is there; and with the real simulator, watched from within. Beside both, in turns of half a
second, a bare Zenoh round trip of the same sizes at the same pace between two processes.
"""

from __future__ import annotations

import math
import statistics
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.motion.bare import BareEcho
from benchmarks.motion.cell import MotionCell
from benchmarks.motion.driver import ARM, STATE_PERIOD, Driver
from benchmarks.motion.record import read_latencies
from benchmarks.motion.requests import Client, first_motions
from benchmarks.report import Report, Table, median, percentile

RATES = (250, 500)
TURNS, SECONDS = 20, 0.5  # of each kind; a driver that is silent for 1.5 s counts as gone
REQUESTS = 20
_HEADER = (
    "driver", "commands per s", "µs median", "µs p99", "µs p99.9", "bare Zenoh µs median / p99", "ratio of medians",
    "late or never %",
)  # fmt: skip


def run(world: str = "pick_station", seconds: float = SECONDS) -> Report:
    rows: list[list[str]] = []
    motions: list[list[str]] = []
    for rate in RATES:
        latencies, bare, motion = with_own_driver(world, rate, seconds)
        rows.append(_row("this process, a perfect arm", rate, latencies, bare))
        motions += motion
        rows.append(_row("the simulator", rate, *with_simulator(world, rate, seconds)))
    remarks = (
        "From the driver's publishing an arm state until it holds the command that answers it, while a path is driven, "
        f"running free at speed 1; {TURNS * seconds:.0f} s each. World `{world}` with its router, controller and "
        f"gateway (and planner, if it has a chassis) as processes; states come at {1 / STATE_PERIOD:.0f} Hz. Late is "
        "what takes longer than one period of the controller. The bare round trip moves bytes of the same sizes "
        "between two processes at the same pace, in turns with it; the controller decodes, validates, ticks along "
        "the path, and encodes. The simulator holds the command when its own thread has read it, which waits for the "
        "physics step that runs."
    )
    command = "python -m benchmarks motion"
    title = "From a request to the first motion"
    header = ("request", "commands per s", "ms median", "ms p95", "in control periods, median")
    more = Table(title, header, motions, _MOTION_REMARKS)
    return Report("State to command", command, _HEADER, rows, remarks, [more])


_MOTION_REMARKS = (
    f"From the POST at the gateway to the first command that differs from where the arm stood, {REQUESTS} times each. "
    "A velocity ramps up from the next tick; a path is planned, checked knot by knot and answered first."
)


def with_own_driver(world: str, rate: int, seconds: float) -> tuple[list[float], list[float], list[list[str]]]:
    """Latencies [s] (inf: never answered), bare round trips [s], and rows of the second table."""
    with tempfile.TemporaryDirectory() as folder, MotionCell(Path(folder), world, rate) as cell, Driver(cell) as driver:
        client = Client(cell.http)
        # Its process is there before the path is driven: a driver that is silent for so long would end that.
        with BareEcho(cell.bus, *Driver.sizes_of(cell.joints)) as bare:
            client.wait_until_answered(driver)
            client.drive_for(TURNS * seconds + 5.0, driver)
            for _ in range(TURNS):
                bare.ping_for(seconds, 1.0 / rate)
                driver.run_for(seconds, record=True)
        client.check_drives(driver)
        motions = [
            [name, str(rate), f"{1e3 * median(t):.1f}", f"{1e3 * percentile(t, 0.95):.1f}", f"{median(t) * rate:.1f}"]
            for name, t in first_motions(client, driver, REQUESTS).items()
        ]
        return driver.latencies(1.0 / rate), bare.times, motions


def with_simulator(world: str, rate: int, seconds: float) -> tuple[list[float], list[float]]:
    """Latencies and bare round trips [s], as above."""
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "latencies.json"
        with MotionCell(Path(folder), world, rate, record) as cell:
            client = Client(cell.http)
            client.wait_until_answered()
            client.drive_for(2 * TURNS * seconds + 10.0)
            sizes = Driver.sizes_of(cell.joints)
            turns = []
            with BareEcho(cell.bus, *sizes) as bare:
                for _ in range(TURNS):
                    bare.ping_for(seconds, 1.0 / rate)
                    begun = time.perf_counter()
                    time.sleep(seconds)
                    turns.append((begun, time.perf_counter()))
            client.check_drives()
            time.sleep(0.5)  # until the last one is answered
        return read_latencies(record, rate, turns), bare.times


def _row(name: str, rate: int, latencies: Sequence[float], bare: Sequence[float]) -> list[str]:
    late = statistics.fmean(latency > 1.0 / rate for latency in latencies)
    worst = [percentile(latencies, share) for share in (0.5, 0.99, 0.999)]
    micros = [f"{1e6 * latency:.0f}" if latency < math.inf else "never" for latency in worst]
    floor = f"{1e6 * median(bare):.0f} / {1e6 * percentile(bare, 0.99):.0f}"
    return [name, str(rate), *micros, floor, f"{median(latencies) / median(bare):.2f}", f"{100 * late:.2f}"]


__all__ = ["ARM", "run"]
