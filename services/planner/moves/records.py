"""The moves of a chassis in memory and in SQLite: ids never used twice, a history that survives ``kill -9``."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import islice

from pydantic import ValidationError

from rackhand.runtime.store import Settled, Store
from rackhand.schemas.codec import explain
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import Move, MoveCreate
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.database import Database
from rackhand.services.planner.errors import StoreError

HISTORY_LIMIT = 5000
RESTARTED = "the planner was restarted while this move ran; the chassis was stopped"


class MoveStore:
    """The moves of a store (``moves.MoveRecords``). Opening it closes the moves that a crash left running.

    Such a move is ``failed`` with ``platform_alert_error``; its time stays that of its last record, because nobody
    knows when the planner died. While the planner runs, memory is the truth: nothing here waits for the disk. Each
    change is written as whole rows, so that what could not be written can be written later.
    """

    def __init__(self, store: Store[Database], history_limit: int = HISTORY_LIMIT) -> None:
        self._store = store
        self._limit = history_limit
        self._fault = ""
        self._unwritten: dict[int, int] = {}  # new moves that are not on disk yet: number of the job, id
        self._moves, self._last_id = store.call(_load)
        self.closed = self._close_interrupted()

    def _close_interrupted(self) -> tuple[Move, ...]:
        update = {
            "state": "failed",
            "fail_reason": int(MoveFailReason.PLATFORM_ALERT_ERROR),
            "fail_message": RESTARTED,
        }
        running = self._store.call(_running)
        closed = tuple(self._read(move_id).model_copy(update=update) for move_id in running)
        self._moves.update({move.id: move for move in closed})
        self._store.call(partial(_write, moves=closed))
        return closed

    def add(self, request: MoveCreate, now: int, ended: Move | None) -> Move:
        """Raises ``RequestRefused`` while the store cannot be written."""
        if self._fault:
            raise RequestRefused(RefusalCode.UNAVAILABLE, f"moves cannot be stored: {self._fault}")
        self._last_id += 1
        move = Move(**request.model_dump(), id=self._last_id, state="moving", create_time=now, last_modified_time=now)
        changed = (move,) if ended is None else (ended, move)
        self._moves.update({each.id: each for each in changed})
        while self._moves and (oldest := next(iter(self._moves))) <= move.id - self._limit:
            del self._moves[oldest]
        job = partial(_write, moves=changed, forget_up_to=move.id - self._limit)
        if number := self._store.submit(job, keep=True):
            self._unwritten[number] = move.id
        return move

    def save(self, move: Move) -> None:
        self._moves[move.id] = move
        self._store.submit(partial(_write, moves=(move,)), keep=True)

    def clear(self, but: int | None) -> None:
        self._moves = {move_id: record for move_id, record in self._moves.items() if move_id == but}
        self._store.submit(partial(_clear, but=but), keep=True)

    def settle(self, settled: Settled) -> int | None:
        """The disk's answer to a job. Returns the id of a new move that could not be written; it is tried again."""
        move_id = self._unwritten.pop(settled.number, None)
        if settled.error is None:
            self._fault = ""
            return None
        if move_id is not None:
            self._fault = str(settled.error)
        return move_id

    def get(self, move_id: int) -> Move | None:
        return self._read(move_id) if move_id in self._moves else None

    def page(self, offset: int, limit: int | None) -> tuple[Move, ...]:
        most = self._limit if limit is None else min(limit, self._limit)
        newest_first = islice(reversed(self._moves), offset, offset + most)
        return tuple(self._read(move_id) for move_id in newest_first)

    def _read(self, move_id: int) -> Move:
        """Records of former runs are parsed when they are asked for first."""
        record = self._moves[move_id]
        if isinstance(record, str):
            record = self._moves[move_id] = _parse(move_id, record)
        return record


def _load(database: Database) -> tuple[dict[int, Move | str], int]:
    """All records by id, ascending, and the highest id that was ever used."""
    rows = database.connection.execute("SELECT id, record FROM moves ORDER BY id").fetchall()
    return dict(rows), database.last_id("moves")


def _running(database: Database) -> list[int]:
    return [row[0] for row in database.connection.execute("SELECT id FROM moves WHERE state = 'moving' ORDER BY id")]


def _write(database: Database, moves: Sequence[Move], forget_up_to: int = 0) -> None:
    rows = [(move.id, move.state, move.model_dump_json()) for move in moves]
    with database.transaction() as connection:
        connection.executemany("INSERT OR REPLACE INTO moves (id, state, record) VALUES (?, ?, ?)", rows)
        if forget_up_to > 0:
            connection.execute("DELETE FROM moves WHERE id <= ? AND state != 'moving'", (forget_up_to,))


def _clear(database: Database, but: int | None) -> None:
    with database.transaction() as connection:
        connection.execute("DELETE FROM moves WHERE id IS NOT ? AND state != 'moving'", (but,))


def _parse(move_id: int, record: str) -> Move:
    try:
        return Move.model_validate_json(record)
    except ValidationError as error:
        raise StoreError(f"move {move_id} in the store cannot be read: {explain(error)}") from error
