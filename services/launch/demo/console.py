"""What the demonstration prints: one line a step, what is waited for, and a table at the end."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.status import Status
from rich.table import Table

LINE_EVERY = 10.0  # s of wall time between two lines about one wait, where there is no terminal


class Output:
    """In a terminal, what is waited for is a line that changes; elsewhere it is a line now and then."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(soft_wrap=True)
        self._status: Status | None = None
        self._next_line = 0.0
        self._rows: list[tuple[str, float, float]] = []

    def say(self, text: str) -> None:
        self._console.print(text, highlight=False, markup=False)

    def waiting(self, what: str) -> None:
        """News of what the present step waits for."""
        if self._status is not None:
            self._status.update(f"waiting for {what}")
        elif time.monotonic() > self._next_line:
            self._next_line = time.monotonic() + LINE_EVERY
            self.say(f"      waiting for {what}")

    @contextmanager
    def progress(self) -> Iterator[None]:
        """While something is done that ``waiting`` tells of."""
        self._next_line = time.monotonic() + LINE_EVERY
        if not self._console.is_terminal:
            yield
            return
        with self._console.status("") as self._status:
            yield
        self._status = None

    def begin(self, number: int, count: int, title: str, at: float) -> None:
        self.say(f"{number:>2}/{count} {_clock(at)}  {title} …")

    def end(self, title: str, seconds: float, wall: float) -> None:
        """``seconds`` of the robot's clock, ``wall`` of this machine's."""
        self._rows.append((title, seconds, wall))
        self.say(f"      done in {seconds:.1f} s")

    def table(self) -> None:
        table = Table("step", "robot's clock, s", "wall, s")
        for title, seconds, wall in self._rows:
            table.add_row(title, f"{seconds:.1f}", f"{wall:.1f}")
        table.add_section()
        table.add_row("all", f"{sum(row[1] for row in self._rows):.1f}", f"{sum(row[2] for row in self._rows):.1f}")
        self._console.print(table)


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes:02d}:{rest:02d}"
