"""Explanations of moves in memory and in SQLite: the newest few hundred, beside the records of the moves."""

from __future__ import annotations

import zlib
from functools import partial
from typing import Any, Protocol

from rackhand.runtime.store import Store
from rackhand.schemas.codec import codec_for
from rackhand.schemas.explain import Explanation
from rackhand.services.planner.database import Database

KEPT = 300
_SCHEMA = "CREATE TABLE IF NOT EXISTS explanations (id INTEGER PRIMARY KEY, record BLOB NOT NULL)"


class ExplanationRecords(Protocol):
    """Where explanations of moves that have ended are kept. Nothing here waits for the disk."""

    def save(self, explanation: Explanation) -> None:
        """Keep one, in place of an older one."""

    def get(self, move_id: int) -> Explanation | None:
        """That of a move; None where it is not kept."""


class UnkeptExplanations:
    """For as long as the process lasts."""

    def __init__(self) -> None:
        self._kept: dict[int, Explanation] = {}

    def save(self, explanation: Explanation) -> None:
        self._kept[explanation.move.id] = explanation
        _forget(self._kept)

    def get(self, move_id: int) -> Explanation | None:
        return self._kept.get(move_id)


class ExplanationStore:
    """Records of former runs are read when they are asked for first; one that cannot be read is as one not kept."""

    def __init__(self, store: Store[Database]) -> None:
        self._store = store
        self._kept: dict[int, Explanation | bytes] = dict(store.call(_load))

    def save(self, explanation: Explanation) -> None:
        self._kept[explanation.move.id] = explanation
        _forget(self._kept)
        self._store.submit(partial(_write, explanation=explanation))

    def get(self, move_id: int) -> Explanation | None:
        record = self._kept.get(move_id)
        if isinstance(record, bytes):
            try:
                record = self._kept[move_id] = codec_for(Explanation).loads(zlib.decompress(record))
            except (ValueError, zlib.error):  # of another version
                del self._kept[move_id]
                return None
        return record


def _forget(kept: dict[int, Any]) -> None:
    while len(kept) > KEPT:
        del kept[min(kept)]


def _load(database: Database) -> list[tuple[int, bytes]]:
    database.connection.execute(_SCHEMA)
    return database.connection.execute("SELECT id, record FROM explanations ORDER BY id").fetchall()


def _write(database: Database, explanation: Explanation) -> None:
    record = zlib.compress(codec_for(Explanation).dumps(explanation), 1)
    newest = "SELECT id FROM explanations ORDER BY id DESC LIMIT ?"
    with database.transaction() as connection:
        connection.execute("INSERT OR REPLACE INTO explanations VALUES (?, ?)", (explanation.move.id, record))
        connection.execute(f"DELETE FROM explanations WHERE id NOT IN ({newest})", (KEPT,))
