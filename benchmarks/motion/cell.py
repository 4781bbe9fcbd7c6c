"""The processes of a cell, with another driver in the simulator's place."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType

from benchmarks.motion.driver import ARM
from rackhand.bus import BusConfig
from rackhand.services.controller.ik import load_arm
from rackhand.services.launch.processes import Address, CellOptions, Process, cell_processes
from rackhand.testing.ports import free_port
from rackhand.worlds.world_model import load_world


class MotionCell:
    """Router, controller at ``rate``, gateway, and the planner if the world has a chassis. With ``record`` the
    simulator runs too and leaves the latencies that it saw there; without, whoever likes is the driver."""

    def __init__(self, folder: Path, world: str, rate: int, record: Path | None = None) -> None:
        self._folder, self._rate, self._record = folder, rate, record
        http, bus = Address("127.0.0.1", free_port()), Address("127.0.0.1", free_port())
        self.http = http.url
        self.bus = BusConfig(connect=bus.endpoint)
        arms = load_world(world).arms
        self.joints = load_arm(arms[ARM].kind).n
        options = CellOptions(world=world, http=http, bus=bus, state_dir=folder / "var", viewer=None)
        options = replace(options, crf={arm: Address("127.0.0.1", free_port()) for arm in arms})
        self._rows = [self._adapted(row) for row in cell_processes(options, {}) if record or row.name != "sim"]
        self._running: list[subprocess.Popen[bytes]] = []

    def _adapted(self, row: Process) -> Process:
        argv = list(row.argv)
        if row.name.startswith("controller"):
            argv[argv.index("--rate") + 1] = str(self._rate)
            argv += ["--keep-alive", "600"]  # nobody refreshes the client's grant
        if row.name == "sim":
            at = argv.index("rackhand.services.sim")
            argv[at : at + 1] = ["benchmarks.motion.timed_sim", str(self._record)]
        return replace(row, argv=tuple(argv))

    def __enter__(self) -> MotionCell:
        try:
            for row in self._rows:
                with (self._folder / f"{row.name}.log").open("wb") as log:
                    environment = os.environ | dict(row.env)
                    self._running.append(
                        subprocess.Popen(row.argv, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
                    )
                if row.name == "router":
                    _wait_for(row.listens)
        except BaseException:
            self._stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop()
        if error is not None:
            for row in self._rows:
                print(
                    f"-- {row.name}", (self._folder / f"{row.name}.log").read_text()[-2000:], sep="\n", file=sys.stderr
                )

    def _stop(self) -> None:
        for process in reversed(self._running):
            process.terminate()
        for process in self._running:
            with suppress(subprocess.TimeoutExpired):
                process.wait(10)
            process.kill()
            process.wait()
        self._running.clear()


def _wait_for(address: Address | None) -> None:
    assert address is not None
    deadline = time.monotonic() + 20.0
    while True:
        with suppress(OSError), socket.create_connection((address.host, address.port), 1.0):
            return
        if time.monotonic() > deadline:
            raise TimeoutError(f"nobody listens on {address}")
        time.sleep(0.05)
