"""A move type is one file and one row: the toy of this package is registered and runs through the whole core."""

from __future__ import annotations

from collections.abc import Callable

from tests.planner.behaviors import toy_turn
from tests.planner.fakes import Cell

ROW = {"follow_target": toy_turn.for_request}  # in place of the behaviour of a type that needs no target


def test_a_toy_move_type_runs_from_request_to_end(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(behaviors=ROW)
    move = cell.create(type="follow_target", target_x=None, target_y=None, properties={"seconds": 1})
    cell.tick(10)
    assert cell.twist.angular > 0.3 and cell.twist.linear == 0.0
    assert (cell.planning().move_intent, cell.planning().target) == ("turn", None)
    cell.tick(16)
    assert cell.get(move.id).state == "succeeded"


def test_a_toy_move_type_is_held_and_resumed_like_any_other(make_cell: Callable[..., Cell]) -> None:
    from rackhand.schemas.chassis import SetEmergencyStop

    cell = make_cell(behaviors=ROW)
    move = cell.create(type="follow_target", target_x=None, target_y=None, properties={"seconds": 1})
    cell.tick(10)
    cell.ask(SetEmergencyStop(enable=True))
    cell.tick(100)
    assert (cell.twist.angular, cell.get(move.id).state) == (0.0, "moving")
    cell.ask(SetEmergencyStop(enable=False))
    cell.tick(10)
    assert cell.get(move.id).state == "moving", "15 of its 25 ticks were left"
    cell.tick(6)
    assert cell.get(move.id).state == "succeeded"
