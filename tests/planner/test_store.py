"""What was said is on disk, what could not be written is undone, and the control thread never touches the disk."""

from __future__ import annotations

import os
import queue
import signal
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from rackhand.bus import Posted
from rackhand.schemas import topics
from rackhand.schemas.maps import DeleteMap, ListMaps, MapRequest, SelectMap
from rackhand.schemas.moves import CancelMove, CreateMove, GetMove, ListMoves, Move, MoveCreate, MoveRequest
from rackhand.schemas.parameters import GetParameters, ParameterChanges, ParametersRequest, SetParameters
from rackhand.services.planner.chassis import Chassis
from rackhand.services.planner.moves.records import RESTARTED
from rackhand.services.planner.service import PlannerService
from rackhand.services.planner.store import PlannerStore
from tests.planner.fakes import Cell, a_map
from tests.runtime.list_bus import Asked, ListBus

MS = 1_000_000


class Planner(ListBus):
    """A planner's service whose store has its thread; the test is the control thread."""

    def __init__(self, cell: Cell, path: Path) -> None:
        super().__init__()
        self.posted: queue.SimpleQueue[Posted] = queue.SimpleQueue()
        self.store = PlannerStore(path, "amr1")
        self.cell = cell
        model = cell.chassis._state.model
        assert model is not None
        cell.chassis = Chassis(cell.motion, self.store.moves, self.store.maps, self.store.parameters)
        self.service = PlannerService(self, "amr1", cell.chassis, self.store)  # type: ignore[arg-type]
        cell.chassis.on_message(model)
        cell.chassis.set_driver_fault("")
        cell.sense()

    def poster(self, handler: Callable[[Any], None]) -> Callable[[Any], None]:
        return lambda item: self.posted.put(Posted(handler, item))

    def settle(self, count: int = 1) -> None:
        """Take in what the store has to say."""
        for _ in range(count):
            self.dispatch(self.posted.get(timeout=20))

    def settle_all(self) -> None:
        """Until nothing is left to be done in the threads of the store and of maps."""
        self.store._thread.call(lambda _: None)
        while self.service._maps._running is not None or not self.posted.empty():
            self.settle()
            self.store._thread.call(lambda _: None)

    def ask(self, query: Any, message: Any) -> Asked:
        asked = Asked(query, message)
        self.dispatch(asked)
        return asked

    def move(self, request: Any) -> Asked:
        return self.ask(topics.MOVES, MoveRequest(request=request))

    def map(self, request: Any) -> Asked:
        return self.ask(topics.MAPS, MapRequest(request=request))

    def parameters(self, request: Any) -> Asked:
        return self.ask(topics.CHASSIS_PARAMETERS, ParametersRequest(request=request))

    def in_thread(self, job: Callable[[sqlite3.Connection], Any]) -> Any:
        return self.store._thread.call(lambda database: job(database.connection))

    def fill_disk(self) -> None:
        self.in_thread(lambda c: c.execute("PRAGMA wal_checkpoint(TRUNCATE)"))
        pages = self.in_thread(lambda c: c.execute("PRAGMA page_count").fetchone()[0])
        self.in_thread(lambda c: c.execute(f"PRAGMA max_page_count = {pages}"))

    def make_room(self) -> None:
        self.in_thread(lambda c: c.execute("PRAGMA max_page_count = 100000"))


@pytest.fixture
def planner(make_cell: Callable[..., Cell], tmp_path: Path) -> Iterator[Planner]:
    path = tmp_path / "planner.sqlite"
    with PlannerStore(path, "amr1") as store:
        store.maps.use(store.maps.create(a_map(), 0))
    planner = Planner(make_cell(), path)
    yield planner
    planner.store.close()


CREATE = CreateMove(move=MoveCreate(target_x=3.0, target_y=0.0))
SLOW = SetParameters(changes=ParameterChanges(max_forward_velocity=0.1))
LARGE = CreateMove(move=MoveCreate(target_x=3.0, target_y=0.0, properties={"note": "x" * 500_000}))


def test_no_statement_runs_in_the_control_thread(planner: Planner) -> None:
    """Neither of requests, nor of a move that ends in a tick, nor of reading what was written."""
    ran: list[int] = []
    planner.in_thread(lambda c: c.set_trace_callback(lambda _: ran.append(threading.get_ident())))
    first, second = planner.move(CREATE), planner.move(CREATE)
    planner.settle_all()
    planner.cell.script.ticks = [ZeroDivisionError("by zero")]
    with pytest.raises(ZeroDivisionError):
        planner.service.tick(False)
    planner.service.tick_failed(ZeroDivisionError("by zero"))
    written = len(ran)
    for request in (GetMove(id=1), GetMove(), ListMoves(), CancelMove()):
        planner.move(request)
    for asked in (a_map("second"), ListMaps(), SelectMap(id=2), DeleteMap(id=2)):
        planner.map(asked)
    planner.settle_all()
    assert first.answer.moves[0].id == 1 and second.answer.moves[0].id == 2
    assert len(ran) > written > 0
    assert set(ran).isdisjoint({threading.get_ident()})


def test_a_move_begins_at_once_and_is_answered_and_published_when_it_is_on_disk(planner: Planner) -> None:
    planner.in_thread(lambda c: c.execute("PRAGMA busy_timeout = 120000"))  # a first tick may compile
    with sqlite3.connect(planner.store.path, isolation_level=None) as other:
        other.execute("BEGIN IMMEDIATE")
        asked = planner.move(CREATE)
        read = planner.move(GetMove(id=1))
        command = planner.service.tick(False)
        assert command.twist.linear > 0, "no disk is waited for in a tick"
        assert (asked.answer, read.answer) == (None, None)
        assert planner.published(topics.MOVE_EVENT) == []
        other.execute("ROLLBACK")
    other.close()
    planner.settle()
    assert asked.answer.moves[0].state == "moving"
    assert read.answer.moves[0].id == 1
    assert [event.event for event in planner.published(topics.MOVE_EVENT)] == ["created"]
    rows = planner.in_thread(lambda c: c.execute("SELECT id, state FROM moves").fetchall())
    assert rows == [(1, "moving")]


def test_a_move_that_cannot_be_stored_is_refused_and_stopped_and_stored_when_there_is_room(planner: Planner) -> None:
    planner.fill_disk()
    asked = planner.move(LARGE)
    planner.settle()
    assert asked.answer == ("unavailable", "could not be stored: database or disk is full")
    move = planner.store.moves.get(1)
    assert move is not None
    assert (move.state, move.fail_reason) == ("failed", 1002)
    assert move.fail_message == "the move could not be stored: database or disk is full"
    again = planner.move(CREATE)
    assert again.answer is None
    planner.settle_all()
    assert again.answer == ("unavailable", "moves cannot be stored: database or disk is full")
    planner.make_room()
    while planner.in_thread(lambda c: c.execute("SELECT count(*) FROM moves WHERE state = 'failed'").fetchone()) != (
        1,
    ):
        planner.settle()
    planner.settle_all()
    last = planner.move(CREATE)
    planner.settle()
    assert last.answer.moves[0].id == 2, "the id of the refused one is not used again"


def test_a_store_that_is_locked_or_read_only_refuses_moves_until_it_is_not(planner: Planner) -> None:
    planner.in_thread(lambda c: c.execute("PRAGMA busy_timeout = 0"))
    with sqlite3.connect(planner.store.path, isolation_level=None) as other:
        other.execute("BEGIN IMMEDIATE")
        asked = planner.move(CREATE)
        planner.settle()
        other.execute("ROLLBACK")
    other.close()
    assert asked.answer == ("unavailable", "could not be stored: database is locked")
    while planner.store.moves._fault:
        planner.settle()
    planner.in_thread(lambda c: c.execute("PRAGMA query_only = ON"))
    asked = planner.move(CREATE)
    while asked.answer is None:
        planner.settle()
    assert asked.answer == ("unavailable", "could not be stored: attempt to write a readonly database")
    assert planner.service.tick(False).twist.linear == 0, "and the chassis is driven no further"


def test_a_map_that_cannot_be_stored_is_refused_and_undone(planner: Planner) -> None:
    rows = planner.map(ListMaps()).answer.maps
    planner.fill_disk()
    created = planner.map(
        a_map("second", overlays={"type": "FeatureCollection", "features": [], "note": "x" * 500_000})
    )
    selected = planner.map(SelectMap(id=2))
    running = planner.map(ListMaps())
    planner.settle_all()
    assert created.answer[0] == "unavailable"
    assert selected.answer[0] in ("unavailable", "not_found"), "it is taken up before or after the first is undone"
    assert "database or disk is full" in created.answer[1]
    assert running.answer is not None
    assert planner.map(ListMaps()).answer.maps == rows
    assert planner.store.maps.current is not None and planner.store.maps.current.map_name == "hall"
    assert planner.cell.motion.map is not None and planner.cell.motion.map.map_name == "hall"
    assert planner.published(topics.MAP)[-1].map.map_name == "hall"
    planner.make_room()
    created = planner.map(a_map("second"))
    planner.settle_all()
    assert created.answer.data.map_name == "second"


def test_parameters_take_effect_at_once_and_are_answered_when_they_are_on_disk(planner: Planner) -> None:
    planner.in_thread(lambda c: c.execute("PRAGMA busy_timeout = 120000"))  # a first tick may compile
    planner.move(CREATE)
    planner.settle()
    with sqlite3.connect(planner.store.path, isolation_level=None) as other:
        other.execute("BEGIN IMMEDIATE")
        asked = planner.parameters(SLOW)
        assert planner.service.tick(False).twist.linear == pytest.approx(0.1)
        assert asked.answer is None
        other.execute("ROLLBACK")
    other.close()
    planner.settle()
    assert asked.answer.values.max_forward_velocity == 0.1
    assert planner.in_thread(lambda c: c.execute("SELECT value FROM meta WHERE key = 'parameters'").fetchone()) == (
        '{"max_forward_velocity":0.1}',
    )


def test_parameters_that_cannot_be_stored_are_refused_and_undone(planner: Planner) -> None:
    planner.parameters(SetParameters(changes=ParameterChanges(max_forward_velocity=0.3)))
    planner.settle_all()
    planner.in_thread(lambda c: c.execute("PRAGMA query_only = ON"))
    asked, read = planner.parameters(SLOW), planner.parameters(GetParameters())
    assert planner.cell.motion.settings.control.max_forward_velocity == 0.1
    planner.settle_all()
    assert asked.answer == ("unavailable", "could not be stored: attempt to write a readonly database")
    assert read.answer is not None
    again = planner.parameters(GetParameters())
    assert again.answer.values.max_forward_velocity == 0.3
    assert planner.cell.motion.settings.control.max_forward_velocity == 0.3
    planner.in_thread(lambda c: c.execute("PRAGMA query_only = OFF"))
    asked = planner.parameters(SLOW)
    planner.settle_all()
    assert asked.answer.values.max_forward_velocity == 0.1


def test_all_that_was_answered_is_there_after_a_restart(planner: Planner, tmp_path: Path) -> None:
    planner.parameters(SLOW)
    planner.move(CREATE)
    planner.move(CREATE)
    planner.move(CancelMove())
    planner.map(a_map("second"))
    planner.map(SelectMap(id=2))
    planner.settle_all()
    moves, current = planner.store.moves.page(0, None), planner.store.maps.current
    planner.store.close()
    with PlannerStore(tmp_path / "planner.sqlite", "amr1") as store:
        assert store.moves.page(0, None) == moves
        assert [move.state for move in moves] == ["cancelled", "cancelled"]
        assert store.maps.current == current
        assert store.parameters.changes == ParameterChanges(max_forward_velocity=0.1)
        assert [row.map_name for row in store.maps.list()] == ["hall", "second"]


WRITER = """
import queue, sys
from pathlib import Path
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.moves.book import MoveBook
from rackhand.services.planner.store import PlannerStore
settled = queue.SimpleQueue()
store = PlannerStore(Path(sys.argv[1]), "amr1")
store.on_settled(settled.put)
book = MoveBook(store.moves)
while True:
    move, _ = book.create(MoveCreate(type="standard", target_x=1.0, target_y=2.0), 1000)
    while (done := settled.get()).number < store.submitted:
        pass
    assert done.error is None
    print(move.id, flush=True)
"""


def test_kill_9_loses_no_move_that_was_reported_as_written(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        reported = [int(writer.stdout.readline()) for _ in range(20)]
        os.kill(writer.pid, signal.SIGKILL)
        reported += [int(line) for line in writer.stdout.read().split("\n")[:-1]]
    with PlannerStore(path, "amr1") as store:
        moves: dict[int, Move] = {move.id: move for move in store.moves.page(0, None)}
        last = max(moves)
        assert set(reported) <= set(moves)
        assert last - max(reported) <= 1
        assert {move.state for move in moves.values() if move.id != last} == {"cancelled"}
        assert (moves[last].state, moves[last].fail_message) == ("failed", RESTARTED)


def test_a_store_of_another_robot_is_refused_in_the_caller_s_thread(tmp_path: Path) -> None:
    PlannerStore(tmp_path / "store.sqlite", "amr1").close()
    with pytest.raises(Exception, match="store of robot 'amr1', not of 'amr2'"):
        PlannerStore(tmp_path / "store.sqlite", "amr2")
    PlannerStore(tmp_path / "store.sqlite", "amr1").close()
