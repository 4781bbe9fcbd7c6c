"""Explanations of scripted moves: what each says, and that they outlast the planner."""

from __future__ import annotations

from pathlib import Path

import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import SetEmergencyStop
from rackhand.schemas.explain import Evidence, ExplainMove, Explanation, Measure, Thing
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.database import Database
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.moves.explanations import KEPT, ExplanationStore
from tests.gateway.explanations import explanation
from tests.planner.fakes import ARRIVED, Cell, driving

WALL = Thing(role="blocks", kind="virtual wall", name="north", x=1.0, y=0.5, clearance=-0.1, needed=0.05)


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    return Cell(tmp_path / "planner.sqlite")


def explain(cell: Cell, move_id: int | None = None) -> Explanation:
    return cell.chassis.explain(ExplainMove(id=move_id)).explanation


def test_a_failed_move_is_explained_by_its_evidence(cell: Cell) -> None:
    measure = Measure(name="time", value=16.0, expected=15.0, unit="s")
    evidence = Evidence(things=(WALL,), measures=(measure,))
    cell.script.ticks = [driving(), MoveFailed(MoveFailReason.MOVE_TIMEOUT, "no progress", evidence)]
    move = cell.create()
    cell.tick(5)
    found = explain(cell, move.id)
    assert (found.verdict, found.move.state, found.evidence) == ("failed", "failed", evidence)
    assert found.cause == "no progress; virtual wall 'north' at (1.00, 0.50): clearance -0.10 m, needed 0.05 m"
    assert found.advice.startswith("remove what blocks the way")
    assert found.pose == Pose2(x=0.0, y=0.0, yaw=0.0) and len(found.trace) and found.costmap is not None
    assert found.costmap.cost.size <= 160 * 160


def test_a_waiting_move_says_what_it_waits_for_and_what_to_do(cell: Cell) -> None:
    cell.create()
    cell.tick(3)
    cell.ask(SetEmergencyStop(enable=True))
    cell.tick(30)
    found = explain(cell)
    assert (found.verdict, found.cause) == ("waiting", "the move waits: the emergency stop is on")
    assert found.advice.startswith("release the emergency stop")
    assert found.held[0].seconds == pytest.approx(1.2, abs=0.05)


def test_a_move_that_was_held_long_is_slow_and_a_fast_one_says_so(cell: Cell) -> None:
    slow = cell.create()
    cell.tick(3)
    cell.pause()
    cell.tick(100)
    cell.pause(paused=False)
    cell.script.ticks = [ARRIVED]
    cell.tick(2)
    cell.script.ticks = [driving(), ARRIVED]
    fast = cell.create()
    cell.tick(5)
    assert explain(cell, slow.id).verdict == "slow"
    assert "held for 4.0 s by: the move is paused on request" in explain(cell, slow.id).cause
    assert (explain(cell, fast.id).verdict, explain(cell, fast.id).costmap) == ("succeeded", None)
    assert explain(cell, fast.id).cause.endswith("nothing held it")


def test_a_replaced_and_a_cancelled_move_say_what_ended_them(cell: Cell) -> None:
    first, second = cell.create(), cell.create()
    cell.cancel()
    assert explain(cell, first.id).cause == "replaced by a newer move"
    assert explain(cell, second.id).cause == "cancelled on request"


def test_an_unknown_move_is_refused_as_not_found(cell: Cell) -> None:
    for move_id in (None, 99):
        with pytest.raises(RequestRefused) as refused:
            explain(cell, move_id)
        assert refused.value.code is RefusalCode.NOT_FOUND


def test_a_move_whose_evidence_is_not_kept_is_explained_by_its_record(cell: Cell) -> None:
    cell.script.ticks = [MoveFailed(MoveFailReason.ROTATE_TIMEOUT, "no progress of the turn")]
    move = cell.create()
    cell.tick(2)
    again = Cell(cell.path.with_name("copy.sqlite"))
    again.moves.save(cell.get(move.id))
    found = explain(again, move.id)
    assert (found.verdict, found.cause) == ("failed", "no progress of the turn") and found.advice


def test_explanations_outlast_the_process_and_the_oldest_go(tmp_path: Path) -> None:
    base = explanation()
    with Database(tmp_path / "s.sqlite", "amr1") as database:
        store = ExplanationStore(database)
        for number in range(1, KEPT + 3):
            store.save(base.model_copy(update={"move": base.move.model_copy(update={"id": number})}))
        assert store.get(2) is None
    with Database(tmp_path / "s.sqlite", "amr1") as database:
        kept = ExplanationStore(database).get(3)
        assert kept is not None and kept.move.id == 3
        assert kept.evidence == base.evidence and (kept.trace == base.trace).all()
        assert ExplanationStore(database).get(2) is None


def test_a_record_of_another_version_is_as_one_not_kept(tmp_path: Path) -> None:
    with Database(tmp_path / "s.sqlite", "amr1") as database:
        ExplanationStore(database)
        database.connection.execute("INSERT INTO explanations VALUES (7, x'00')")
        assert ExplanationStore(database).get(7) is None
