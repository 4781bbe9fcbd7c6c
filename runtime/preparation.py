"""Progress of compilation: what a service reports while it compiles, and what ``rackhand prepare`` reads.

Compiling everything takes minutes on a slow machine, and happens once: see ``compiled``.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from rackhand.runtime.compiled import ready_functions

REPORT_EVERY = 5.0  # seconds between lines in a service's log
LINE_EVERY = 0.5  # seconds between lines for ``rackhand prepare``

Report = Callable[[int, int], None]


@contextmanager
def progress(report: Report, every: float = REPORT_EVERY) -> Iterator[None]:
    """Calls ``report(ready, functions)`` in a thread of its own every so many seconds, if more functions are ready
    than before. What takes less than ``every`` seconds, as loading from the cache does, is not reported.
    """
    done = threading.Event()
    thread = threading.Thread(target=_watch, args=(report, every, done), name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def logged_progress(log: Any) -> AbstractContextManager[None]:
    """``progress`` as lines of a service's log."""
    return progress(lambda ready, functions: log.info(f"first start: compiled {ready} of {functions} functions"))


def _watch(report: Report, every: float, done: threading.Event) -> None:
    before = ready_functions()[0]
    while not done.wait(every):
        ready, functions = ready_functions()
        if ready > before:
            report(ready, functions)
        before = ready


def prepare(warm_up: Callable[[], None]) -> None:
    """Run ``warm_up`` and print ``READY FUNCTIONS`` lines to standard output meanwhile; both are equal in the last."""

    def line(ready: int, functions: int) -> None:
        print(ready, functions, flush=True)

    line(*ready_functions())
    with progress(line, LINE_EVERY):
        warm_up()
    functions = ready_functions()[1]
    line(functions, functions)
