"""Overlays changed while a move runs: they act at once, and neither the move nor what was observed is lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rackhand.schemas.maps import ChangeOverlays, GetMap, SelectMap
from rackhand.schemas.moves import ClearMoves, ListMoves, MoveRequest
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from tests.planner.fakes import Cell


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    return Cell(tmp_path / "planner.sqlite")


def wall(*points: tuple[float, float]) -> dict[str, Any]:
    """Overlays with one virtual wall."""
    geometry = {"type": "LineString", "coordinates": [list(point) for point in points]}
    feature = {"type": "Feature", "id": "w", "geometry": geometry, "properties": {"lineType": 2}}
    return {"type": "FeatureCollection", "features": [feature]}


def test_a_wall_is_there_at_once_and_the_move_goes_on(cell: Cell) -> None:
    move = cell.create()
    cell.tick(3)
    costmap = cell.motion.perception.costmap
    assert costmap is not None and not costmap.static.blocked.any()
    observed = costmap.observed
    reply = cell.ask_maps(ChangeOverlays(overlays=wall((-0.9, -1.9), (-0.7, -1.9))))
    assert reply.data is not None and reply.data.overlays_version == 1
    now = cell.motion.perception.costmap
    assert now is not None and now.static.blocked.any() and now.observed is observed
    assert np.isfinite(now.mapped.at(-0.8, -1.8)) and now.mapped.at(-0.8, -1.8) < 0.2
    cell.tick(3)
    assert cell.get(move.id).state == "moving"


def test_the_stored_map_has_them_too_and_so_after_a_restart(cell: Cell) -> None:
    overlays = wall((0.0, 0.0), (0.1, 0.0))
    cell.ask_maps(ChangeOverlays(overlays=overlays))
    stored = cell.ask_maps(GetMap(id=1)).data
    assert stored is not None and (stored.overlays, stored.overlays_version) == (overlays, 1)
    cell.database.close()
    again = Cell(cell.path)
    assert again.maps.current is not None and again.maps.current.overlays == overlays


@pytest.mark.parametrize(("overlays", "code"), [({"type": "x"}, RefusalCode.INVALID), (None, RefusalCode.NOT_FOUND)])
def test_what_cannot_be_changes_nothing(cell: Cell, overlays: dict[str, Any] | None, code: RefusalCode) -> None:
    if overlays is None:
        cell.ask_maps(SelectMap())
    before = cell.maps.current
    with pytest.raises(RequestRefused) as refused:
        cell.ask_maps(ChangeOverlays(overlays=overlays or wall((0.0, 0.0), (1.0, 0.0))))
    assert refused.value.code is code and cell.maps.current is before


def test_moves_that_have_ended_are_forgotten_for_good_and_the_running_one_is_not(cell: Cell) -> None:
    cell.create()
    running = cell.create()
    cell.chassis.moves(MoveRequest(request=ClearMoves()))
    listed = cell.chassis.moves(MoveRequest(request=ListMoves())).moves
    assert [move.id for move in listed] == [running.id]
    cell.database.close()
    again = Cell(cell.path)
    assert [move.id for move in again.moves.page(0, None)] == [running.id]
    assert again.create().id == running.id + 1, "ids are not used again"
