"""A supervisor in a process of its own, and small children for it."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PATIENCE = 30.0  # seconds; a bound on hanging, not a measure of anything


def python(code: str) -> list[str]:
    """The command of a small child."""
    return [sys.executable, "-I", "-S", "-u", "-c", code]


# Says its pid and stays until it is told to end.
STAY = python("import os, signal; print('pid', os.getpid()); signal.pause()")


@dataclass
class Running:
    """A started program whose lines can be awaited."""

    process: subprocess.Popen[str]
    lines: list[str] = field(default_factory=list)
    _unclaimed: list[str] = field(default_factory=list)
    _queue: queue.Queue[str | None] = field(default_factory=queue.Queue)

    def __post_init__(self) -> None:
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        with contextlib.suppress(ValueError):  # a test may close it
            for line in self.process.stdout:
                self._queue.put(line.rstrip("\n"))
        self._queue.put(None)

    def until(self, part: str) -> str:
        """The first line that holds ``part`` and was not returned before. Lines of several children may interleave."""
        deadline = time.monotonic() + PATIENCE
        while (found := next((line for line in self._unclaimed if part in line), None)) is None:
            line = self._queue.get(timeout=max(deadline - time.monotonic(), 0.001))
            assert line is not None, f"ended without saying {part!r}: {self.lines}"
            self.lines.append(line)
            self._unclaimed.append(line)
        self._unclaimed.remove(found)
        return found

    def pid_of(self, name: str) -> int:
        """The pid that child ``name`` says next."""
        return int(self.until(f"{name:<8}pid").rpartition(" ")[2])

    def end(self) -> int:
        """Exit code, once it has ended and all its lines are read."""
        code = self.process.wait(PATIENCE)
        while (line := self._queue.get(timeout=PATIENCE)) is not None:
            self.lines.append(line)
        return code


@pytest.fixture
def run() -> Iterator[Callable[[list[str]], Running]]:
    """Start a program; it is killed at the end of the test if it still runs."""
    started: list[Running] = []

    def start(argv: list[str], **environment: str) -> Running:
        process = subprocess.Popen(
            argv,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            text=True,
            cwd=ROOT,
            env={**os.environ, **environment},
            start_new_session=True,
            # Tests that run under nohup pass it on: the supervisor would rightly stay when it is hung up on.
            preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
        )
        started.append(Running(process))
        return started[-1]

    yield start
    for running in started:
        if running.process.poll() is None:
            running.process.send_signal(signal.SIGKILL)
            running.process.wait()


@pytest.fixture
def supervise(run: Callable[[list[str]], Running]) -> Callable[..., Running]:
    """Start a supervisor: ``supervise({"name": argv, …} or rows, policy={…}, grace=…)``."""

    def start(processes: dict[str, list[str]] | list[dict[str, Any]], **settings: Any) -> Running:
        rows = processes if isinstance(processes, list) else [{"name": n, "argv": a} for n, a in processes.items()]
        return run([sys.executable, "-m", "tests.launch.supervise", json.dumps({"processes": rows, **settings})])

    return start


def alive(pid: int) -> bool:
    """Whether the process still runs (a zombie does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def gone(pid: int) -> bool:
    """Wait, within bounds, until a process does not run any more."""
    deadline = time.monotonic() + PATIENCE
    while alive(pid):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True
