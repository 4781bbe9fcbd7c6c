"""Progress of something that takes long: bars in a terminal, plain lines every 10 s elsewhere."""

from __future__ import annotations

import sys
import threading
import time
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

LINE_EVERY = 10.0  # seconds


class Progress:
    """One bar, or one part of a line, for each name given to ``show``. Nothing is written in the first ``every``
    seconds where there is no terminal.
    """

    def __init__(self, unit: str = "", stream: TextIO | None = None, every: float = LINE_EVERY) -> None:
        self._unit, self._stream, self._every = unit, stream or sys.stdout, every
        self._console = Console(file=self._stream)
        columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
        self._bars = Bars(*columns, console=self._console) if self._console.is_terminal else None
        self._tasks: dict[str, TaskID] = {}
        self._counts: dict[str, tuple[int, int | None]] = {}
        self._lock = threading.Lock()
        self._done = threading.Event()
        self._writer = threading.Thread(target=self._write_lines, name="progress", daemon=True)

    def __enter__(self) -> Progress:
        if self._bars is not None:
            self._bars.start()
        else:
            self._writer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        if self._bars is not None:
            self._bars.stop()
        else:
            self._writer.join()

    def show(self, name: str, done: int, total: int | None) -> None:
        """``done`` of ``total`` of ``name``, or of an unknown number. From any thread."""
        with self._lock:
            self._counts[name] = done, total
            if self._bars is not None:
                if name not in self._tasks:
                    self._tasks[name] = self._bars.add_task(name, total=total)
                self._bars.update(self._tasks[name], completed=done, total=total)

    def say(self, text: str) -> None:
        """A line that stays."""
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def _write_lines(self) -> None:
        begun = time.monotonic()
        while not self._done.wait(self._every):
            with self._lock:
                counts = [_count(name, done, total) for name, (done, total) in self._counts.items()]
            unit = f" {self._unit}" if self._unit and counts else ""
            self.say(f"{', '.join(counts) or 'nothing done yet'}{unit} after {time.monotonic() - begun:.0f} s")


def _count(name: str, done: int, total: int | None) -> str:
    return name if total is None else f"{name} {done} of {total}"
