"""A thread that owns what is kept on disk, so that no control loop ever waits for a disk."""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)
T = TypeVar("T")

RETRY = 1.0  # s between attempts at what could not be written and must not be lost


class Store(Protocol[R_co]):
    """Where jobs on a resource (a database, a log) are carried out, in order."""

    def call(self, job: Callable[[R_co], T]) -> T:
        """Carry a job out and wait for its result: for start-up, never in a control loop."""

    def submit(self, job: Callable[[R_co], object], keep: bool = False) -> int:
        """Carry a job out some time, and return its number. ``keep``: if it fails, it is tried again until it works."""


@dataclass(frozen=True)
class Settled:
    """Job ``number``, and all before it, are on disk, or it failed with ``error``."""

    number: int
    error: Exception | None = None


@dataclass(frozen=True)
class _Job:
    number: int
    run: Callable[[Any], object]
    keep: bool
    result: Future[Any] | None = None


class StoreThread(Generic[R]):
    """A ``Store`` in a thread of its own, which opens, uses and closes the resource: nobody else ever touches it.

    ``settled`` is called in that thread for each submitted job. After a job has failed, further ones fail untried until
    the owner has called ``resume``: they were submitted in the belief that the failed one would work. Jobs to ``keep``
    wait then, and are tried again every ``retry`` seconds and before any other job.
    """

    def __init__(
        self,
        name: str,
        open_resource: Callable[[], R],
        close: Callable[[R], None],
        settled: Callable[[Settled], None] = lambda _: None,
        retry: float = RETRY,
    ) -> None:
        """Raises what ``open_resource`` raises."""
        self._open, self._close, self._retry = open_resource, close, retry
        self.settled = settled
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._kept: deque[_Job] = deque()
        self._fault: Exception | None = None
        self.submitted = 0
        opened: Future[None] = Future()
        self._thread = threading.Thread(target=self._run, args=(opened,), name=name, daemon=True)
        self._thread.start()
        opened.result()

    def call(self, job: Callable[[R], T]) -> T:
        result: Future[T] = Future()
        self._jobs.put(_Job(0, job, False, result))
        return result.result()

    def submit(self, job: Callable[[R], object], keep: bool = False) -> int:
        self.submitted += 1
        self._jobs.put(_Job(self.submitted, job, keep))
        return self.submitted

    def resume(self) -> None:
        """The owner knows of the failure and has undone what it had assumed; jobs from now on are tried again."""
        self._jobs.put(_Job(0, lambda _: self._forgive(), False, Future()))

    def close(self) -> None:
        """Returns when all that was submitted is done, or has failed once more."""
        self._jobs.put(None)
        self._thread.join()

    # -- in the thread -----------------------------------------------------------------------------------------------

    def _run(self, opened: Future[None]) -> None:
        try:
            resource = self._open()
        except BaseException as error:
            opened.set_exception(error)
            return
        opened.set_result(None)
        try:
            self._serve(resource)
        finally:
            self._close(resource)

    def _serve(self, resource: R) -> None:
        while True:
            try:
                job = self._jobs.get(timeout=self._retry if self._kept else None)
            except queue.Empty:
                self._try_kept(resource)
                continue
            if job is None:
                self._try_kept(resource)
                return
            if job.result is not None:
                self._answer(resource, job, job.result)
            else:
                self.settled(Settled(job.number, self._carry_out(resource, job)))

    def _answer(self, resource: R, job: _Job, result: Future[Any]) -> None:
        try:
            result.set_result(job.run(resource))
        except BaseException as error:
            result.set_exception(error)

    def _carry_out(self, resource: R, job: _Job) -> Exception | None:
        if (error := self._fault) is None:
            error = self._try_kept(resource) or self._attempt(resource, job)
        if error is not None:
            self._fault = error
            if job.keep:
                self._kept.append(job)
        return error

    def _try_kept(self, resource: R) -> Exception | None:
        while self._kept:
            if (error := self._attempt(resource, self._kept[0])) is not None:
                return error
            job = self._kept.popleft()
            self.settled(Settled(job.number))
        return None

    @staticmethod
    def _attempt(resource: R, job: _Job) -> Exception | None:
        try:
            job.run(resource)
        except Exception as error:
            return error
        return None

    def _forgive(self) -> None:
        self._fault = None
