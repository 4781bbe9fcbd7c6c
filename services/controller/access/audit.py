"""The audit log on disk: one JSON object a line, appended and never rewritten."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from rackhand.services.controller.access.types import AuditEntry


class AuditLog:
    """Appends entries with the time of day, unbuffered; not for the control loop.

    Raises ``OSError`` when the file cannot be opened or written; then it is as long as it was, so that the same entries
    may be written again.
    """

    def __init__(self, path: Path, wall: Callable[[], float] = time.time) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("ab", buffering=0)
        self._wall = wall

    def write(self, entries: Iterable[AuditEntry]) -> None:
        when = datetime.fromtimestamp(self._wall(), UTC).isoformat(timespec="milliseconds")
        lines = [msgspec.json.encode({"wall": when, **asdict(entry)}) + b"\n" for entry in entries]
        size = self._file.seek(0, os.SEEK_END)
        try:
            self._append(b"".join(lines))
        except OSError:
            with suppress(OSError):
                self._file.truncate(size)
            raise

    def _append(self, data: bytes) -> None:
        while data:  # a full disk may take a part of it
            data = data[self._file.write(data) :]

    def close(self) -> None:
        self._file.close()


class DenialLimiter:
    """Keeps a flood of refusals from filling the disk: of equal ones (client, action, code) the first each second.

    The next one written says how many were left out.
    """

    def __init__(self, window_ns: int = 1_000_000_000, most: int = 1024) -> None:
        self._window_ns = window_ns
        self._most = most
        self._seen: dict[tuple[str, str, int], tuple[int, int]] = {}

    def filter(self, entries: Iterable[AuditEntry]) -> list[AuditEntry]:
        return [kept for entry in entries if (kept := self._keep(entry)) is not None]

    def _keep(self, entry: AuditEntry) -> AuditEntry | None:
        if entry.code == 200:
            return entry
        key = (entry.client, entry.action, entry.code)
        since, left_out = self._seen.get(key, (-self._window_ns, 0))
        if entry.monotonic_ns - since < self._window_ns:
            self._seen[key] = (since, left_out + 1)
            return None
        if len(self._seen) >= self._most:
            self._seen.clear()
        self._seen[key] = (entry.monotonic_ns, 0)
        return _with_note(entry, left_out) if left_out else entry


def _with_note(entry: AuditEntry, left_out: int) -> AuditEntry:
    return AuditEntry(**{**asdict(entry), "text": f"{entry.text} ({left_out} like it before left out)"})
