"""Moves in SQLite: ids that are never used twice, a history that survives ``kill -9``."""

from __future__ import annotations

from pydantic import ValidationError

from rackhand.schemas.codec import explain
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import Move, MoveCreate
from rackhand.services.planner.database import Database
from rackhand.services.planner.errors import StoreError

HISTORY_LIMIT = 5000
RESTARTED = "the planner was restarted while this move ran; the chassis was stopped"


class MoveStore:
    """The move table of a store (``moves.MoveRecords``). Opening it closes the moves that a crash left running.

    Such a move is ``failed`` with ``platform_alert_error``; its time stays that of its last record, because nobody
    knows when the planner died.
    """

    def __init__(self, database: Database, history_limit: int = HISTORY_LIMIT) -> None:
        self._database = database
        self._limit = history_limit
        self.closed = self._close_interrupted()

    def _close_interrupted(self) -> tuple[Move, ...]:
        rows = self._database.connection.execute("SELECT id, record FROM moves WHERE state = 'moving'").fetchall()
        update = {
            "state": "failed",
            "fail_reason": int(MoveFailReason.PLATFORM_ALERT_ERROR),
            "fail_message": RESTARTED,
        }
        closed = tuple(_read(*row).model_copy(update=update) for row in rows)
        with self._database.transaction():
            for move in closed:
                self.save(move)
        return closed

    def add(self, request: MoveCreate, now: int, ended: Move | None) -> Move:
        with self._database.transaction() as connection:
            if ended is not None:
                self.save(ended)
            cursor = connection.execute("INSERT INTO moves (state, record) VALUES ('moving', '')")
            move = Move(
                **request.model_dump(),
                id=int(cursor.lastrowid or 0),
                state="moving",
                create_time=now,
                last_modified_time=now,
            )
            self.save(move)
            connection.execute("DELETE FROM moves WHERE id <= ? AND state != 'moving'", (move.id - self._limit,))
        return move

    def save(self, move: Move) -> None:
        self._database.connection.execute(
            "UPDATE moves SET state = ?, record = ? WHERE id = ?", (move.state, move.model_dump_json(), move.id)
        )

    def get(self, move_id: int) -> Move | None:
        if not -(2**63) <= move_id < 2**63:
            return None
        rows = self._database.connection.execute("SELECT id, record FROM moves WHERE id = ?", (move_id,))
        return next((_read(*row) for row in rows), None)

    def page(self, offset: int, limit: int | None) -> tuple[Move, ...]:
        most = self._limit if limit is None else min(limit, self._limit)
        rows = self._database.connection.execute(
            "SELECT id, record FROM moves ORDER BY id DESC LIMIT ? OFFSET ?", (most, min(offset, 2**62))
        )
        return tuple(_read(*row) for row in rows)


def _read(move_id: int, record: str) -> Move:
    try:
        return Move.model_validate_json(record)
    except ValidationError as error:
        raise StoreError(f"move {move_id} in the store cannot be read: {explain(error)}") from error
