"""Long requests are parsed beside the control loop: a path of thousands of points takes longer than a period."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, wait
from dataclasses import dataclass

from rackhand.services.controller.protocol.parse import Parsed

LONG = 4096  # characters; what is shorter is read at once
MAX_WAITING = 64


@dataclass
class Reading:
    """A request that is being parsed. ``overtaken``: a stop, or the end of its session, arrived meanwhile."""

    session: str
    text: str
    ticket: object
    future: Future[Parsed] | None = None
    overtaken: bool = False

    @property
    def done(self) -> bool:
        return self.future is None or self.future.done()


class ParseQueue:
    """Keeps the order of each session's requests: a short one waits behind its session's long ones."""

    def __init__(self, executor: Executor, read: Callable[[str], Parsed]) -> None:
        self._executor, self._read = executor, read
        self._waiting: deque[Reading] = deque()

    @property
    def busy(self) -> bool:
        return bool(self._waiting)

    @property
    def full(self) -> bool:
        return len(self._waiting) >= MAX_WAITING

    def wanted(self, session: str, text: str) -> bool:
        """Whether this request has to wait here."""
        return len(text) > LONG or any(reading.session == session for reading in self._waiting)

    def take(self, session: str, text: str, ticket: object) -> None:
        future = self._executor.submit(self._read, text) if len(text) > LONG else None
        self._waiting.append(Reading(session, text, ticket, future))

    def overtake(self, session: str | None = None) -> None:
        """Requests that are being parsed must not move the arm any more: of one session, or of all."""
        for reading in self._waiting:
            reading.overtaken |= session in (None, reading.session)

    def collect(self, lockstep: bool = False) -> Iterator[Reading]:
        """The requests that are parsed and next of their session. ``lockstep``: waits for all of them."""
        if lockstep:
            wait([reading.future for reading in self._waiting if reading.future is not None])
        held: set[str] = set()
        waiting, self._waiting = self._waiting, deque()
        while waiting:
            reading = waiting.popleft()
            if reading.done and reading.session not in held:
                yield reading
            else:
                held.add(reading.session)
                self._waiting.append(reading)
