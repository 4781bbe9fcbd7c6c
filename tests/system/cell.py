"""A whole cell for a test: all its services as real processes, on free ports, with a state of its own.

with Cell(tmp_path, "--speed", "max") as cell:
    httpx.get(f"{cell.http}/healthz")
    cell.kill("planner")            # SIGKILL; the supervisor brings it back
    cell.wait_until_up()
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

import yaml

from rackhand.bus import BusConfig
from rackhand.services.launch.cell import CELL_FILE
from rackhand.services.launch.child import GUARD
from rackhand.services.launch.health import Health, ask_health

ROOT = Path(__file__).parents[2]
# Bounds on hanging, in wall seconds; nothing is measured by them. The very first start compiles for a minute.
START = 240.0
PATIENCE = 60.0
POLL = 0.05

T = TypeVar("T")


def environment() -> dict[str, str]:
    """This process's own, without what a surrounding ``make`` says to another ``make``."""
    return {key: value for key, value in os.environ.items() if key not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS", "ARGS")}


def without_arms(folder: Path, world: str = "warehouse") -> str:
    """A copy of a world in ``folder``, without its arms: what tests that are about driving run in.

    Arms are commanded 250 times a simulated second; in lockstep a cell that has them takes twice as long.
    """
    copy = folder / world
    shutil.copytree(ROOT / "worlds" / world, copy)
    content = yaml.safe_load((copy / "world.yaml").read_text())
    del content["arms"]
    (copy / "world.yaml").write_text(yaml.safe_dump(content))
    return str(copy)


class CellError(AssertionError):
    """The cell did not do what the test waited for; the text ends with the last lines of its log."""


class Cell:
    """``rackhand up`` with the given options, started on entry and stopped on exit.

    ``http`` is the gateway's URL, ``bus`` the router's end point, ``crf`` where each arm's CRF clients connect;
    ``folder`` holds the log and the state. With a ``viewer``, that is its page's URL, and ``viewer_stream`` what
    Rerun's native viewer opens.
    """

    http: str
    bus: str
    viewer: str
    viewer_stream: str
    crf: dict[str, str]

    def __init__(
        self, folder: Path, *options: str, environment: dict[str, str] | None = None, viewer: bool = False
    ) -> None:
        self.folder = folder
        self.log = folder / "cell.log"
        self.state_dir = folder / "var"
        self._options = (*options, *(("--viewer-port", "0") if viewer else ("--no-viewer",)))
        self._environment = environment or {}
        self._supervisor: subprocess.Popen[bytes] | None = None
        self._told_before = 0  # when a former cell wrote its facts, in ns

    def __enter__(self) -> Cell:
        self.start()
        try:
            self.wait_until_up(START)
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    @property
    def supervisor(self) -> subprocess.Popen[bytes]:
        assert self._supervisor is not None, "the cell was not started"
        return self._supervisor

    def command(self) -> list[str]:
        """What starts the supervisor."""
        own = ["--port", "0", "--bus-port", "0", "--state-dir", str(self.state_dir)]
        guarded = [sys.executable, str(GUARD), str(os.getpid())]  # a test that is killed leaves no cell behind
        return [*guarded, sys.executable, "-m", "rackhand.services.launch", "up", *own, *self._options]

    def start(self) -> None:
        """Start the supervisor, and wait until it has told its ports; the services may still be starting."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):
            self._told_before = (self.state_dir / CELL_FILE).stat().st_mtime_ns
        with self.log.open("ab") as log:
            self._supervisor = subprocess.Popen(
                self.command(),
                cwd=ROOT,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**environment(), **self._environment},
                process_group=0,
            )
        facts = self.wait_for(self._facts, "its ports are told")
        self.http, self.bus, self.crf = facts["http"], facts["bus"], facts.get("crf", {})
        self.viewer, self.viewer_stream = facts.get("viewer", ""), facts.get("viewer_stream", "")

    def stop(self) -> int:
        """Ask the supervisor to stop and wait until it has; returns its exit code."""
        if self.supervisor.poll() is None:
            self.supervisor.terminate()
            try:
                self.supervisor.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                self.supervisor.kill()
                self.supervisor.wait()
                raise CellError(f"the supervisor did not stop\n{self.tail()}") from None
        return self.supervisor.returncode

    # -- processes ---------------------------------------------------------------------------------------------------

    def pid(self, service: str) -> int:
        """The pid of ``router``, ``sim``, ``planner``, ``controller`` or ``gateway`` as last started."""
        facts = self._facts() or {"pids": {}}
        if service not in facts["pids"]:
            raise CellError(f"{service} does not run\n{self.tail()}")
        return int(facts["pids"][service])

    def kill(self, service: str, number: signal.Signals = signal.SIGKILL) -> int:
        """Send a signal (SIGKILL if none is named) to a service. Returns the pid it had."""
        pid = self.pid(service)
        os.kill(pid, number)
        return pid

    def wait_until_restarted(self, service: str, former_pid: int, timeout: float = PATIENCE) -> int:
        """Wait until a service runs with another pid, and return that."""

        def fresh() -> int | None:
            pid = ((self._facts() or {}).get("pids") or {}).get(service, former_pid)
            return int(pid) if pid != former_pid else None

        return self.wait_for(fresh, f"{service} is started again", timeout)

    # -- health ------------------------------------------------------------------------------------------------------

    def health(self) -> Health | None:
        """What ``/healthz`` says now; None while no gateway answers."""
        return ask_health(self.http)

    def wait_until_up(self, timeout: float = PATIENCE) -> Health:
        """Wait until ``/healthz`` tells that all is up."""
        return self._wait_for_health(lambda health: health.all_up, "every service is up", timeout)

    def wait_until_there(self, service: str, timeout: float = PATIENCE) -> Health:
        """Wait until ``/healthz`` tells that ``robot/service`` is up, expected or not (as ``cell/viewer``)."""
        return self._wait_for_health(lambda health: service in health.up, f"{service} is told to be up", timeout)

    def wait_until_down(self, service: str, timeout: float = PATIENCE) -> Health:
        """Wait until ``/healthz`` tells that ``robot/service`` (as in ``amr1/planner``) is not up."""
        return self._wait_for_health(lambda health: service in health.down, f"{service} is told to be down", timeout)

    def _wait_for_health(self, holds: Callable[[Health], bool], what: str, timeout: float) -> Health:
        def found() -> Health | None:
            health = self.health()
            return health if health is not None and holds(health) else None

        try:
            return self.wait_for(found, what, timeout)
        except CellError as error:
            raise CellError(f"/healthz tells: {self.health()}\n{error}") from None

    # -- waiting -----------------------------------------------------------------------------------------------------

    def wait_for(self, found: Callable[[], T | None], what: str, timeout: float = PATIENCE) -> T:
        """Poll until ``found()`` is something. Raises ``CellError`` with the log when it never is, or the cell ends."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            ended = self.supervisor.poll() is not None
            if (value := found()) is not None:
                return value
            if ended:
                raise CellError(f"the cell ended before {what}\n{self.tail()}")
            time.sleep(POLL)
        raise CellError(f"waited {timeout:g} s in vain until {what}\n{self.tail()}")

    def bus_config(self) -> BusConfig:
        """For a ``Bus`` of the test's own."""
        return BusConfig(connect=self.bus)

    def tail(self, lines: int = 60) -> str:
        """The last lines of the log of all processes."""
        with suppress(FileNotFoundError):
            return "\n".join(self.log.read_text(errors="replace").splitlines()[-lines:])
        return ""

    def _facts(self) -> dict[str, Any] | None:
        """Ports and pids as this cell tells them; None before it has."""
        path = self.state_dir / CELL_FILE
        with suppress(FileNotFoundError):
            if path.stat().st_mtime_ns > self._told_before:
                return dict(json.loads(path.read_text()))
        return None
