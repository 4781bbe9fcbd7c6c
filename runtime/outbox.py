"""What a service may not say before it is on disk."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from rackhand.runtime.store import Settled


@dataclass(frozen=True)
class _Entry:
    first: int  # of its own jobs; one more than ``last`` where it has none
    last: int
    send: Callable[[], None]
    refuse: Callable[[str], None] | None


class Outbox:
    """Sends replies and publications in order, each once all jobs that a store was given before it are settled.

    So nothing that was said is lost by ``kill -9``, and nobody waits while nothing is being written.
    """

    def __init__(self, submitted: Callable[[], int]) -> None:
        """``submitted``: the number of the last job that was given to the store."""
        self._submitted = submitted
        self._settled = submitted()
        self._failed: dict[int, str] = {}
        self._waiting: deque[_Entry] = deque()

    def put(
        self, send: Callable[[], None], refuse: Callable[[str], None] | None = None, since: int | None = None
    ) -> None:
        """Send when it may be said. A reply to a request that had submitted jobs after number ``since`` becomes
        ``refuse(why)`` if one of them fails."""
        last = self._submitted()
        self._waiting.append(_Entry(last + 1 if since is None else since + 1, last, send, refuse))
        self._flush()

    def settle(self, settled: Settled) -> None:
        self._settled = max(self._settled, settled.number)
        if settled.error is not None and self._waiting:
            self._failed[settled.number] = str(settled.error)
        self._flush()

    def _flush(self) -> None:
        while self._waiting and self._waiting[0].last <= self._settled:
            entry = self._waiting.popleft()
            why = next((self._failed[n] for n in range(entry.first, entry.last + 1) if n in self._failed), None)
            if why is None or entry.refuse is None:
                entry.send()
            else:
                entry.refuse(why)
        if not self._waiting:
            self._failed.clear()
