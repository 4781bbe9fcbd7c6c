"""Map requests whose work takes long: what is answered meanwhile, in which order, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

import pytest

from rackhand.schemas import topics
from rackhand.schemas.maps import (
    ANSWER_SECONDS,
    WORK_SECONDS,
    ChangeOverlays,
    DeleteMap,
    GetMap,
    ListMaps,
    MapReply,
    MapRequest,
    PatchMap,
    SelectMap,
    UseMapData,
)
from rackhand.schemas.refusal import RequestRefused
from rackhand.services.planner.map.line import MapLine
from tests.planner.fakes import Cell, a_map
from tests.runtime.list_bus import Asked


class Later(Executor):
    """Does the work when the test says so."""

    def __init__(self) -> None:
        self.jobs: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, job: Any, /, *_: Any, **__: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.jobs.append((future, job))
        return future

    def work(self) -> None:
        future, job = self.jobs.pop(0)
        try:
            future.set_result(job())
        except Exception as error:
            future.set_exception(error)


class Desk:
    """A cell whose map requests go through a line, and the clock."""

    def __init__(self, cell: Cell) -> None:
        self.cell, self.worker, self.now = cell, Later(), 0.0
        self.line = MapLine(cell.chassis.map_work, self._answer, self.worker, lambda handler: handler, lambda: self.now)

    def _answer(self, request: Any, made: Any) -> None:
        try:
            request.reply(self.cell.chassis.maps(request.message, None if made is None else made()))
        except RequestRefused as refused:
            request.refuse(refused.code, refused.text)

    def ask(self, request: Any) -> Asked:
        asked = Asked(topics.MAPS, MapRequest(request=request))
        self.line.put(asked)
        return asked

    @property
    def in_use(self) -> str:
        assert self.cell.maps.current is not None
        return self.cell.maps.current.map_name


@pytest.fixture
def desk(cell: Cell) -> Desk:
    cell.ask_maps(a_map("second"))
    return Desk(cell)


def test_a_map_is_in_use_when_it_was_loaded_and_the_move_goes_on_till_then(desk: Desk) -> None:
    move = desk.cell.create()
    selected = desk.ask(SelectMap(id=2))
    desk.cell.tick(3)
    assert selected.answer is None and desk.in_use == "hall"
    assert desk.cell.get(move.id).state == "moving"
    desk.worker.work()
    assert selected.answer.data.map_name == desk.in_use == "second"
    assert desk.cell.get(move.id).state == "failed"


def test_what_only_reads_is_answered_meanwhile_and_the_rest_in_order(desk: Desk) -> None:
    selected, patched = desk.ask(SelectMap(id=2)), desk.ask(PatchMap(id=2, map_name="renamed"))
    deleted = desk.ask(DeleteMap(id=2))
    assert desk.ask(GetMap()).answer.data.map_name == "hall"
    assert len(desk.ask(ListMaps()).answer.maps) == 2
    assert (selected.answer, patched.answer, deleted.answer) == (None, None, None)
    desk.worker.work()
    assert desk.in_use == "second", "as it was when it was selected"
    assert patched.answer.data.map_name == "renamed" and deleted.answer is not None


def test_two_loads_do_not_overtake_each_other(desk: Desk) -> None:
    first, second = desk.ask(UseMapData(map=a_map("given"))), desk.ask(SelectMap(id=1))
    assert len(desk.worker.jobs) == 1
    desk.worker.work()
    assert (first.answer.data.map_name, second.answer, desk.in_use) == ("given", None, "given")
    desk.worker.work()
    assert second.answer.data.map_name == desk.in_use == "hall"


@pytest.mark.parametrize("noticed_before_it_ends", [True, False])
def test_a_load_that_takes_too_long_is_refused_and_changes_nothing(desk: Desk, noticed_before_it_ends: bool) -> None:
    selected, patched = desk.ask(SelectMap(id=2)), desk.ask(PatchMap(id=2, map_name="renamed"))
    desk.now = WORK_SECONDS / 2
    desk.line.check()
    later = desk.ask(DeleteMap(id=2))
    assert (selected.answer, patched.answer) == (None, None)
    desk.now = WORK_SECONDS + 1.0
    assert desk.now < ANSWER_SECONDS, "who asked still waits"
    if noticed_before_it_ends:
        desk.line.check()
        assert selected.answer is not None and patched.answer is not None and later.answer is None
    desk.worker.work()
    for code, text in (selected.answer, patched.answer):
        assert code == "unavailable" and "after 30 s; nothing has changed" in text
    assert desk.in_use == "hall" and isinstance(later.answer, MapReply)
    assert desk.ask(SelectMap(id=1)).answer is None
    desk.worker.work()
    assert desk.in_use == "hall" and desk.worker.jobs == []


@pytest.mark.parametrize(
    ("asked", "code", "text"),
    [
        (UseMapData(map=a_map("given").model_copy(update={"png": b"x"})), "invalid", "not a PNG image"),
        (SelectMap(id=2), "internal", "ZeroDivisionError"),
        (SelectMap(id=9), "not_found", "there is no map 9"),
    ],
)
def test_a_load_that_fails_is_refused_by_name_and_the_next_is_served(
    desk: Desk, asked: Any, code: str, text: str
) -> None:
    refused, again = desk.ask(asked), desk.ask(SelectMap(id=1))
    if code == "internal":
        desk.worker.jobs[0] = (desk.worker.jobs[0][0], lambda: 1 / 0)
    if code != "not_found":
        desk.worker.work()
    assert refused.answer[0] == code and text in refused.answer[1]
    assert desk.in_use == "hall"
    desk.worker.work()
    assert again.answer.data.map_name == desk.in_use == "hall"


def test_a_map_that_changed_while_it_was_loaded_is_loaded_again(desk: Desk) -> None:
    """By a write that could not be stored and is undone, say: what is in use is what the store has."""
    selected = desk.ask(SelectMap(id=2))
    desk.cell.ask_maps(PatchMap(id=2, map_name="patched"))
    desk.worker.work()
    assert selected.answer.data.map_name == desk.in_use == "patched"


def test_overlays_of_the_map_in_use_are_loaded_beside_too(desk: Desk) -> None:
    geometry = {"type": "LineString", "coordinates": [[-0.9, -1.9], [-0.7, -1.9]]}
    wall = {"type": "Feature", "id": "w", "geometry": geometry, "properties": {"lineType": 2}}
    move = desk.cell.create()
    changed = desk.ask(ChangeOverlays(overlays={"type": "FeatureCollection", "features": [wall]}))
    costmap = desk.cell.motion.perception.costmap
    assert changed.answer is None and costmap is not None and not costmap.static.blocked.any()
    desk.worker.work()
    assert changed.answer.data.overlays_version == 1 and costmap.static.blocked.any()
    desk.cell.tick()
    assert desk.cell.get(move.id).state == "moving"
