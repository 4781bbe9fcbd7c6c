"""The audit log is written beside the control loop: a disk may take its time."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterable, Sequence

from rackhand.services.controller.access.audit import AuditLog, DenialLimiter
from rackhand.services.controller.access.types import AuditEntry


class AuditWriter:
    """Hands entries to a thread of its own. ``close`` waits until all are written.

    ``failed`` is called, in that thread, with what went wrong; what could not be written is lost, and the next entries
    are tried again.
    """

    def __init__(self, log: AuditLog, failed: Callable[[OSError], None]) -> None:
        self._log, self._failed = log, failed
        self._limiter = DenialLimiter()
        self._entries: queue.SimpleQueue[Sequence[AuditEntry] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="audit", daemon=True)
        self._thread.start()

    def put(self, entries: Iterable[AuditEntry]) -> None:
        kept = self._limiter.filter(entries)
        if kept:
            self._entries.put(kept)

    def close(self) -> None:
        self._entries.put(None)
        self._thread.join()
        self._log.close()

    def _run(self) -> None:
        while (entries := self._entries.get()) is not None:
            try:
                self._log.write(entries)
            except OSError as error:
                self._failed(error)
