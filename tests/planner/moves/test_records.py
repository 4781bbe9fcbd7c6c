"""Moves in SQLite: what was acknowledged is there after a crash, and a crash is told as what it was."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import Move, MoveCreate
from rackhand.schemas.refusal import RequestRefused
from rackhand.services.planner.database import Database
from rackhand.services.planner.errors import StoreError
from rackhand.services.planner.moves.book import MoveBook
from rackhand.services.planner.moves.records import RESTARTED, MoveStore

A_MOVE = MoveCreate(type="standard", target_x=1.0, target_y=2.0)
REASONS = st.sampled_from([reason for reason in MoveFailReason if reason])


class Moves(RuleBasedStateMachine):
    """Create, replace, cancel, finish, crash in any order; a model of what a client was told is the judge."""

    def __init__(self) -> None:
        super().__init__()
        self.directory = Path(tempfile.mkdtemp())
        self.told: dict[int, Move] = {}
        self.now = 1000
        self.generation = 0
        self.open(self.directory / "0.sqlite")

    def open(self, path: Path) -> None:
        self.path = path
        self.database = Database(path, "amr1")
        self.book = MoveBook(MoveStore(self.database))

    @rule(x=st.floats(-50, 50), properties=st.dictionaries(st.text(max_size=3), st.text(max_size=3), max_size=2))
    def create(self, x: float, properties: dict[str, str]) -> None:
        request = A_MOVE.model_copy(update={"target_x": x, "properties": properties | {"inplace_rotate": True}})
        running = self.book.current
        move, replaced = self.book.create(request, self.now)
        assert move.id > max(self.told, default=0)
        assert (replaced is None) == (running is None)
        if running is not None:
            self.told[running.id] = running.model_copy(
                update={
                    "state": "cancelled",
                    "fail_message": "replaced by a newer move",
                    "last_modified_time": max(self.now, running.create_time),
                }
            )
        self.told[move.id] = move

    @rule()
    def refused(self) -> None:
        with pytest.raises(RequestRefused):
            self.book.create(MoveCreate(type="standard"), self.now)

    @precondition(lambda self: self.book.current is not None)
    @rule(state=st.sampled_from(["succeeded", "cancelled"]))
    def end(self, state: str) -> None:
        move = self.book.end(state, self.now)  # type: ignore[arg-type]
        self.told[move.id] = self.told[move.id].model_copy(update={"state": state, "last_modified_time": self.later()})

    @precondition(lambda self: self.book.current is not None)
    @rule(reason=REASONS, text=st.text(max_size=20))
    def fail(self, reason: MoveFailReason, text: str) -> None:
        move = self.book.end("failed", self.now, reason, text)
        self.told[move.id] = self.told[move.id].model_copy(
            update={
                "state": "failed",
                "fail_reason": int(reason),
                "fail_message": text,
                "last_modified_time": self.later(),
            }
        )

    @rule(seconds=st.integers(-50, 50))
    def time_passes_or_is_reset(self, seconds: int) -> None:
        self.now += seconds

    @rule()
    def crash(self) -> None:
        """What a killed process leaves: the files as they are, write-ahead log included, nothing closed."""
        self.generation += 1
        image = self.directory / f"{self.generation}.sqlite"
        for suffix in ("", "-wal"):
            if (part := Path(f"{self.path}{suffix}")).exists():
                shutil.copyfile(part, f"{image}{suffix}")
        running = self.book.current
        self.database.close()
        self.open(image)
        if running is not None:
            self.told[running.id] = running.model_copy(
                update={"state": "failed", "fail_reason": 1000, "fail_message": RESTARTED}
            )

    def later(self) -> int:
        move = self.book.last
        assert move is not None
        return max(self.now, move.create_time)

    @invariant()
    def the_store_holds_what_was_told(self) -> None:
        assert self.book.page(0, None) == tuple(self.told[i] for i in sorted(self.told, reverse=True))

    @invariant()
    def at_most_the_newest_runs(self) -> None:
        running = [move for move in self.told.values() if move.state == "moving"]
        assert running == ([] if self.book.current is None else [self.book.current])
        assert self.book.last == (self.told[max(self.told)] if self.told else None)

    def teardown(self) -> None:
        self.database.close()
        shutil.rmtree(self.directory)


Moves.TestCase.settings = settings(max_examples=25, stateful_step_count=25, deadline=None)
TestMoves = Moves.TestCase


WRITER = """
import sys
from pathlib import Path
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.database import Database
from rackhand.services.planner.moves.records import MoveStore
from rackhand.services.planner.moves.book import MoveBook
book = MoveBook(MoveStore(Database(Path(sys.argv[1]), "amr1")))
while True:
    move, _ = book.create(MoveCreate(type="standard", target_x=1.0, target_y=2.0), 1000)
    print(move.id, flush=True)
"""


def test_kill_9_of_a_writing_planner_leaves_finished_records(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        acknowledged = [int(writer.stdout.readline()) for _ in range(20)]
        os.kill(writer.pid, signal.SIGKILL)
        acknowledged += [int(line) for line in writer.stdout.read().split("\n")[:-1]]
    assert writer.returncode == -signal.SIGKILL
    with Database(path, "amr1") as database:
        store = MoveStore(database)
        moves = {move.id: move for move in store.page(0, None)}
        last = max(moves)
        assert set(acknowledged) <= set(moves)
        assert last - max(acknowledged) <= 1, "at most the one that was not acknowledged any more"
        assert {move.state for move in moves.values() if move.id != last} == {"cancelled"}
        assert (moves[last].state, moves[last].fail_reason, moves[last].fail_message) == ("failed", 1000, RESTARTED)
        assert store.closed == (moves[last],)
        assert MoveBook(store).create(A_MOVE, 2000)[0].id == last + 1


def test_the_history_is_bounded_and_ids_are_never_used_twice(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    with Database(path, "amr1") as database:
        book = MoveBook(MoveStore(database, history_limit=3))
        for _ in range(7):
            book.create(A_MOVE, 1000)
        assert [move.id for move in book.page(0, None)] == [7, 6, 5]
        assert database.connection.execute("SELECT count(*) FROM moves").fetchone() == (3,)
        database.connection.execute("DELETE FROM moves")
    with Database(path, "amr1") as database:
        assert MoveBook(MoveStore(database)).create(A_MOVE, 1000)[0].id == 8


def test_a_record_s_times_never_run_backwards(tmp_path: Path) -> None:
    with Database(tmp_path / "store.sqlite", "amr1") as database:
        book = MoveBook(MoveStore(database))
        book.create(A_MOVE, 1000)
        assert book.end("succeeded", 900).last_modified_time == 1000


def test_two_planners_do_not_share_a_store(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    with Database(path, "amr1") as database:
        MoveBook(MoveStore(database)).create(A_MOVE, 1000)
        with pytest.raises(StoreError, match="in use by another planner"):
            Database(path, "amr1")
    with pytest.raises(StoreError, match="store of robot 'amr1', not of 'amr2'"):
        Database(path, "amr2")
    Database(path, "amr1").close()


def test_a_file_that_is_not_a_store_is_left_alone(tmp_path: Path) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("not a database, but dear to somebody " * 100)
    with pytest.raises(StoreError, match="not a database"):
        Database(text, "amr1")
    assert text.read_text().startswith("not a database, but dear")
    foreign = tmp_path / "foreign.sqlite"
    with sqlite3.connect(foreign) as connection:
        connection.execute("CREATE TABLE moves (id)")
    connection.close()
    before = foreign.read_bytes()
    with pytest.raises(StoreError, match="another program"):
        Database(foreign, "amr1")
    assert foreign.read_bytes() == before


def test_a_damaged_store_is_reported_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    with Database(path, "amr1") as database:
        book = MoveBook(MoveStore(database))
        for _ in range(200):
            book.create(A_MOVE, 1000)
    data = bytearray(path.read_bytes())
    data[4096 * 4 : 4096 * 6] = b"\xff" * 8192
    path.write_bytes(data)
    with pytest.raises(StoreError, match="move it aside"):
        Database(path, "amr1")
    assert path.read_bytes() == bytes(data)


def test_a_newer_store_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    Database(path, "amr1").close()
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA user_version = 9")
    connection.close()
    with pytest.raises(StoreError, match="schema version 9, this planner knows 1"):
        Database(path, "amr1")


def test_a_store_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot be opened"):
        Database(tmp_path / "file" / "store.sqlite", "amr1")
