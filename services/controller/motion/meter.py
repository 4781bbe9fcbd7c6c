"""Durations by the machine's clock, for diagnostics. No decision depends on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

Stopwatch = Callable[[], int]  # nanoseconds


def no_stopwatch() -> int:
    """Without a measurement every duration is 0."""
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
        """In µs; the next call measures from here."""
        longest, self._longest = self._longest, 0
        return longest * 1e-3
