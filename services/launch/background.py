"""A cell as a child process: ``rackhand up`` on free ports, for programs that need a cell of their own.

It reads the ports and pids that the supervisor writes, waits, signals, and stops. A child dies with its parent.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from rackhand.services.launch.cell import CELL_FILE
from rackhand.services.launch.child import GUARD
from rackhand.services.launch.health import Health, ask_health

# Bounds on hanging, in wall seconds; nothing is measured by them. The very first start compiles for some minutes.
START = 600.0
PATIENCE = 60.0
POLL = 0.05

T = TypeVar("T")


def environment() -> dict[str, str]:
    """This process's own, without what a surrounding ``make`` sets for another ``make``."""
    return {key: value for key, value in os.environ.items() if key not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS", "ARGS")}


class CellError(AssertionError):
    """The cell did not do what was waited for; the text ends with the last lines of its log."""


class BackgroundCell:
    """``rackhand up`` with ``options`` (of its command line) on free ports.

    ``folder`` holds its log and its state. ``http`` is the gateway's URL, ``bus`` the router's endpoint, ``crf`` where
    each arm's clients of the packet framing connect; with a live view, ``viewer`` is its page's URL, and
    ``viewer_stream`` what Rerun's native viewer opens.
    """

    http: str
    bus: str
    viewer: str
    viewer_stream: str
    crf: dict[str, str]

    def __init__(self, folder: Path, options: Sequence[str], settings: Mapping[str, str] | None = None) -> None:
        self.folder = folder
        self.log = folder / "cell.log"
        self.state_dir = folder / "var"
        self._options = tuple(options)
        self._settings = dict(settings or {})
        self._supervisor: subprocess.Popen[bytes] | None = None
        self._written_before = 0  # when a former cell wrote its facts, in ns

    @property
    def supervisor(self) -> subprocess.Popen[bytes]:
        """The process of ``rackhand up``."""
        assert self._supervisor is not None, "the cell was not started"
        return self._supervisor

    def command(self) -> list[str]:
        """What starts the supervisor."""
        own = ["--port", "0", "--bus-port", "0", "--state-dir", str(self.state_dir)]
        guarded = [sys.executable, str(GUARD), str(os.getpid())]
        return [*guarded, sys.executable, "-m", "rackhand.services.launch", "up", *own, *self._options]

    def start(self) -> None:
        """Start the supervisor, and wait until it has written its ports; the services may still be starting."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):
            self._written_before = (self.state_dir / CELL_FILE).stat().st_mtime_ns
        with self.log.open("ab") as log:
            self._supervisor = subprocess.Popen(
                self.command(),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**environment(), **self._settings},
                process_group=0,
            )
        facts = self.wait_for(self._facts, "its ports are known")
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
            raise CellError(f"{service} does not run; running: {sorted(facts['pids'])}\n{self.tail()}")
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
        """Wait until ``/healthz`` reports every service as up."""
        return self._wait_for_health(lambda health: health.all_up, "every service is up", timeout)

    def wait_until_there(self, service: str, timeout: float = PATIENCE) -> Health:
        """Wait until ``/healthz`` reports ``robot/service`` as up, expected or not (as ``cell/viewer``)."""
        return self._wait_for_health(lambda health: service in health.up, f"{service} is reported up", timeout)

    def wait_until_down(self, service: str, timeout: float = PATIENCE) -> Health:
        """Wait until ``/healthz`` reports ``robot/service`` (as in ``amr1/planner``) as not up."""
        return self._wait_for_health(lambda health: service in health.down, f"{service} is reported down", timeout)

    def _wait_for_health(self, holds: Callable[[Health], bool], what: str, timeout: float) -> Health:
        def found() -> Health | None:
            health = self.health()
            return health if health is not None and holds(health) else None

        try:
            return self.wait_for(found, what, timeout)
        except CellError as error:
            raise CellError(f"/healthz: {self.health()}\n{error}") from None

    # -- waiting -----------------------------------------------------------------------------------------------------

    def wait_for(self, found: Callable[[], T | None], what: str, timeout: float = PATIENCE) -> T:
        """Poll until ``found()`` is something; ``timeout`` in wall seconds.

        Raises ``CellError`` with the end of the log when it never is, or when the cell ends.
        """
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            ended = self.supervisor.poll() is not None
            if (value := found()) is not None:
                return value
            if ended:
                raise CellError(f"the cell ended before {what}\n{self.tail()}")
            time.sleep(POLL)
        raise CellError(f"not within {timeout:g} s: {what}\n{self.tail()}")

    def tail(self, lines: int = 60) -> str:
        """The last lines of the log of all processes."""
        with suppress(FileNotFoundError):
            return "\n".join(self.log.read_text(errors="replace").splitlines()[-lines:])
        return ""

    def _facts(self) -> dict[str, Any] | None:
        """Ports and pids as this cell writes them; None before it has."""
        path = self.state_dir / CELL_FILE
        with suppress(FileNotFoundError):
            if path.stat().st_mtime_ns > self._written_before:
                return dict(json.loads(path.read_text()))
        return None
