"""Progress of benchmarks on standard error: bars in a terminal, lines every 10 s elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from rackhand.services.launch.progress import Progress

T = TypeVar("T")
_shown: list[Progress] = []  # of the benchmark that runs


@contextmanager
def shown(name: str) -> Iterator[None]:
    """While a benchmark of this name runs."""
    with Progress(stream=sys.stderr) as progress:
        progress.show(name, 0, None)
        _shown.append(progress)
        try:
            yield
        finally:
            _shown.remove(progress)


def track(items: Sequence[T], what: str) -> Iterator[T]:
    """The ``items``, and how many of them have been taken is shown."""
    for number, item in enumerate(items):
        update(what, number, len(items))
        yield item
    update(what, len(items), len(items))


def update(what: str, done: int, total: int) -> None:
    for progress in _shown:
        progress.show(what, done, total)


def say(text: str) -> None:
    """A line on standard error, above the bars."""
    for progress in _shown:
        progress.say(text)
