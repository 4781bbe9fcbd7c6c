"""From the POST of a move to the first turn of a wheel: in simulation time and in wall time, at real-time speed."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from benchmarks.report import Report, median, percentile
from rackhand.bus import Bus, Sample
from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.service import CELL, ServiceId
from rackhand.testing import Cell, Judge
from tests.system.driving import Driver, standard

MOVES = 20
GOAL = (7.0, 1.5)
TURNING = 0.05  # rad/s of a driven wheel, above the encoders' noise


def run() -> Report:
    wall: list[float] = []
    simulated: list[float] = []
    posting: list[float] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        Cell(Path(folder), lockstep=False) as cell,
        Judge(cell.bus) as judge,
        Bus(ServiceId("bench", CELL), cell.bus_config()) as bus,
    ):
        driver = Driver(cell, judge)
        driver.wait_until_joined()
        odometry = bus.inbox().subscribe(topics.ODOMETRY, "amr1", depth=1)
        for _ in range(MOVES):
            stamp, begun = judge.inspect().clock.stamp, time.perf_counter()
            driver.post(standard(*GOAL))  # far enough away for all of them: each goes a few centimetres
            posting.append(time.perf_counter() - begun)
            while True:
                event = odometry.get(timeout=20)
                assert isinstance(event, Sample)
                assert event.message.stamp < stamp + 5 * NANOSECONDS, "no wheel turns"
                if event.message.stamp > stamp and max(map(abs, event.message.wheel_velocities)) > TURNING:
                    break
            wall.append(time.perf_counter() - begun)
            simulated.append((event.message.stamp - stamp) / NANOSECONDS)
            driver.request("PATCH", "/chassis/moves/current", {"state": "cancelled"})
            while max(map(abs, event.message.wheel_velocities)) > TURNING:
                event = odometry.get(timeout=20)
                assert isinstance(event, Sample)
        driver.close()
    rows = [
        (name, f"{median(values) * 1e3:.1f}", f"{percentile(values, 0.95) * 1e3:.1f}", f"{median(values) / 0.04:.2f}")
        for name, values in (
            ("POST answered (wall)", posting),
            ("first wheel motion (wall)", wall),
            ("first wheel motion (simulation)", simulated),
        )
    ]
    return Report(
        "POST to first wheel motion",
        "python -m benchmarks first_motion",
        ("what", "median ms", "p95 ms", "in control periods of 40 ms"),
        rows,
        f"{MOVES} moves at real-time speed over HTTP. A planner answers each second odometry, so half a period goes by "
        "on average; the wheels then speed up with the chassis' acceleration limit.",
    )
