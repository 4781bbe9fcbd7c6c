"""The audit log is written beside the control loop: a disk may take its time."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from rackhand.runtime.store import Settled, StoreThread
from rackhand.services.controller.access.audit import AuditLog, DenialLimiter
from rackhand.services.controller.access.types import AuditEntry


class AuditWriter:
    """Hands entries to a store thread. ``close`` returns when all are written.

    ``failed`` is called, in that thread, with what went wrong. What could not be written is tried again until it is.
    """

    def __init__(self, log: AuditLog, failed: Callable[[Exception], None]) -> None:
        self._failed = failed
        self._limiter = DenialLimiter()
        self._thread = StoreThread("audit", lambda: log, AuditLog.close, self._settled)

    def put(self, entries: Iterable[AuditEntry]) -> None:
        kept = self._limiter.filter(entries)
        if kept:
            self._thread.submit(lambda log: log.write(kept), keep=True)

    def close(self) -> None:
        self._thread.close()

    def _settled(self, settled: Settled) -> None:
        if settled.error is not None:
            self._failed(settled.error)
            self._thread.resume()
