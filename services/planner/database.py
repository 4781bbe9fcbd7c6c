"""The planner's one SQLite file: opened by one process at a time, checked before it is trusted, used by one thread."""

from __future__ import annotations

import fcntl
import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from rackhand.services.planner.errors import StoreError

T = TypeVar("T")

APPLICATION_ID = 0x524B4850  # "RKHP": SQLite's own place for "whose file is this"
SCHEMA_VERSION = 1

_SCHEMA = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE moves (id INTEGER PRIMARY KEY AUTOINCREMENT, state TEXT NOT NULL, record TEXT NOT NULL);
CREATE INDEX moves_running ON moves (state) WHERE state = 'moving';
CREATE TABLE maps (
    id INTEGER PRIMARY KEY AUTOINCREMENT, uid TEXT NOT NULL UNIQUE, record TEXT NOT NULL, png BLOB NOT NULL
);
CREATE TABLE current_map (slot INTEGER PRIMARY KEY CHECK (slot = 1), record TEXT NOT NULL, png BLOB NOT NULL);
"""


class Database:
    """An open store file. Raises ``StoreError`` for a file that is not a usable store of this robot.

    It belongs to the thread that opened it: a running planner opens it in a ``runtime.store.StoreThread``. By itself it
    is a ``Store`` that does each job at once, for tests and tools. A second process is kept out by a lock on
    ``<file>.lock``, which ends with its holder however that ends: two planners on one file would each close the other's
    running move.
    """

    def __init__(self, path: Path, robot: str) -> None:
        self.path = path
        self._lock = _lock(path)
        try:
            self.connection = sqlite3.connect(path, isolation_level=None)
            try:
                self._prepare(robot)
            except BaseException:
                self.connection.close()
                raise
        except sqlite3.Error as error:
            os.close(self._lock)
            raise StoreError(f"{path} cannot be used as the planner's store: {error}. {_WAY_OUT}") from error
        except BaseException:
            os.close(self._lock)
            raise

    def _prepare(self, robot: str) -> None:
        known = self._pragma("application_id")
        empty = not self.connection.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchone()
        if not empty and known != APPLICATION_ID:
            raise StoreError(f"{self.path} is an SQLite file of another program. {_WAY_OUT}")
        if not empty:
            self._check(robot)
        # FULL: a commit is on the disk before a request is answered, so not even a power cut loses it.
        self.connection.execute("PRAGMA journal_mode = WAL")
        self.connection.execute("PRAGMA synchronous = FULL")
        if empty:
            self._create(robot)

    def _check(self, robot: str) -> None:
        version = self._pragma("user_version")
        if version != SCHEMA_VERSION:
            raise StoreError(
                f"{self.path} has schema version {version}, this planner knows {SCHEMA_VERSION}. {_WAY_OUT}"
            )
        damage = [row[0] for row in self.connection.execute("PRAGMA quick_check(3)")]
        if damage != ["ok"]:
            raise StoreError(f"{self.path} is damaged: {'; '.join(damage)}. {_WAY_OUT}")
        owner = self.get("robot")
        if owner != robot:
            raise StoreError(f"{self.path} is the store of robot {owner!r}, not of {robot!r}. {_WAY_OUT}")

    def _create(self, robot: str) -> None:
        with self.transaction():
            for statement in _SCHEMA.split(";"):
                self.connection.execute(statement)
            self.connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
            self.connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            self.set("robot", robot)

    def _pragma(self, name: str) -> int:
        return int(self.connection.execute(f"PRAGMA {name}").fetchone()[0])

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """All or nothing; durable when the block has been left."""
        self.connection.execute("BEGIN IMMEDIATE")
        try:
            yield self.connection
            self.connection.execute("COMMIT")
        except BaseException:
            if self.connection.in_transaction:
                self.connection.execute("ROLLBACK")
            raise

    def call(self, job: Callable[[Database], T]) -> T:
        return job(self)

    def submit(self, job: Callable[[Database], object], keep: bool = False) -> int:  # noqa: ARG002 - it is done at once
        """Returns 0: what is done by now has no number to wait for."""
        job(self)
        return 0

    def last_id(self, table: str) -> int:
        """The highest id that was ever used in an AUTOINCREMENT table."""
        row = self.connection.execute("SELECT seq FROM sqlite_sequence WHERE name = ?", (table,)).fetchone()
        return 0 if row is None else int(row[0])

    def get(self, key: str) -> str | None:
        """A small value kept under a name."""
        row = self.connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return None if row is None else str(row[0])

    def set(self, key: str, value: str) -> None:
        self.connection.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, value))

    def close(self) -> None:
        """Closing twice is closing once."""
        self.connection.close()
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def __enter__(self) -> Database:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


_WAY_OUT = "It was left as it is; move it aside, or choose another file with --store"


def _lock(path: Path) -> int:
    """Take the store for this process. Returns the descriptor that holds the lock."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path.with_name(path.name + ".lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise StoreError(f"{path} cannot be opened: {error.strerror}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        raise StoreError(f"{path} is in use by another planner that still runs") from error
    return descriptor
