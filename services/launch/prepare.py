"""``rackhand prepare``: compiles the hot loops of all services before the first start, with progress.

Each service has a ``warm_up`` module that does it and prints ``READY FUNCTIONS`` lines. Two run at a time: a compiler
uses one core each, and the largest begins first.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field

from rackhand.services.launch.progress import Progress

AT_ONCE = 2


@dataclass(frozen=True)
class Part:
    """What is compiled in one process. ``command`` prints two numbers a line: ready, and of how many."""

    name: str
    command: Sequence[str]


def _warm_up(service: str) -> Part:
    return Part(service, (sys.executable, "-m", f"rackhand.services.{service}.warm_up"))


PARTS = (_warm_up("planner"), _warm_up("controller"), _warm_up("sim"))


class CannotPrepare(Exception):
    """A warm-up ended with an error; the text has its last lines."""


def prepare(parts: Sequence[Part] = PARTS, show: Callable[[str, int, int], None] | None = None) -> float:
    """Run all ``parts``, at most ``AT_ONCE`` at a time. Returns the seconds it took; raises ``CannotPrepare``.

    ``show(name, ready, functions)`` gets their progress; by default it is shown on the terminal, or as lines.
    """
    begun = time.monotonic()
    with Progress("functions") as progress, ThreadPoolExecutor(AT_ONCE) as pool:
        running = _Running(show or progress.show)
        jobs = [pool.submit(running.run, part) for part in parts]
        try:
            for job in as_completed(jobs):
                job.result()
        except BaseException:
            for job in jobs:
                job.cancel()
            running.end()
            raise
    return time.monotonic() - begun


@dataclass
class _Running:
    """The processes that run; ``end`` ends them, and those that would begin later end at once."""

    show: Callable[[str, int, int], None]
    processes: list[subprocess.Popen[str]] = field(default_factory=list)
    ended: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)

    def run(self, part: Part) -> None:
        with self.lock:
            if self.ended:
                return
            process = subprocess.Popen(
                part.command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
            )
            self.processes.append(process)
        other = []
        with process:
            for line in process.stdout or ():
                numbers = line.split()
                if len(numbers) == 2 and all(number.isdecimal() for number in numbers):
                    self.show(f"compiling {part.name}", int(numbers[0]), int(numbers[1]))
                else:
                    other.append(line)
        if process.returncode and not self.ended:
            last = "".join(other[-20:])
            raise CannotPrepare(f"the warm-up of {part.name} ended with exit code {process.returncode}:\n{last}")

    def end(self) -> None:
        with self.lock:
            self.ended = True
            for process in self.processes:
                process.terminate()
