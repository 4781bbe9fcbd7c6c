"""How long things take by the machine's clock: to be told, never to decide by."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

Stopwatch = Callable[[], int]  # nanoseconds


def no_stopwatch() -> int:
    """Where nobody measures, everything takes no time."""
    return 0


class Meter:
    """The longest of the durations since it was last read."""

    def __init__(self, stopwatch: Stopwatch) -> None:
        self._stopwatch = stopwatch
        self._longest = 0

    @contextmanager
    def measure(self) -> Iterator[None]:
        begun = self._stopwatch()
        yield
        self._longest = max(self._longest, self._stopwatch() - begun)

    def read_us(self) -> float:
        """In µs; begins anew."""
        longest, self._longest = self._longest, 0
        return longest * 1e-3
