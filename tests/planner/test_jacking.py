"""The jack: its self-check, errors that are cleared, and orders that interrupt each other."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby

import pytest

from rackhand.schemas import topics
from rackhand.schemas.chassis import ChassisStatus, ClearJackErrors, Jack, JackRequest, JackSelfCheck, SetEmergencyStop
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.jacking import TIME_LIMIT_NS, JackOrders
from tests.planner.fakes import STEP, Cell


class Stroke:
    """A jack that follows its command, a tenth of its stroke a tick; ``weight`` is what its sensor reads when up."""

    def __init__(self, cell: Cell, weight: float = 0.3) -> None:
        self.cell, self.weight, self.stuck_at = cell, weight, 2.0

    def tick(self, count: int = 1) -> None:
        for _ in range(count):
            command = self.cell.tick().jack
            assert self.cell.jack is not None
            step = {"up": 0.1, "down": -0.1, "hold": 0.0}[command]
            progress = min(max(round(self.cell.jack.progress + step, 3), 0.0), 1.0, self.stuck_at)
            state = {"up": "jacking_up", "down": "jacking_down", "hold": "hold"}[command]
            weight = self.weight if progress > 0.5 else 0.0
            self.cell.jack = Jack(stamp=0, state=state, progress=progress, weight=weight)


@pytest.fixture
def jack(make_cell: Callable[..., Cell]) -> Stroke:
    cell = make_cell(jack=Jack(stamp=0, state="hold", progress=0.0, weight=0.0))
    cell.tick()
    return Stroke(cell)


def statuses(cell: Cell) -> list[tuple[bool, str]]:
    """Each once."""
    shown = ((status.jack_checking, status.jack_check) for status in cell.heard(topics.CHASSIS_STATUS))
    return [state for state, _ in groupby(shown)]


def last(cell: Cell) -> ChassisStatus:
    status = cell.heard(topics.CHASSIS_STATUS)[-1]
    assert isinstance(status, ChassisStatus)
    return status


def codes(cell: Cell) -> list[int]:
    return [alert.code for alert in last(cell).alerts]


def test_a_self_check_goes_up_and_down(jack: Stroke) -> None:
    assert jack.cell.ask(JackSelfCheck()).detail == "the jack moves up and down again"
    jack.tick(15)
    assert jack.cell.jack is not None and jack.cell.jack.state == "jacking_down"
    jack.tick(15)
    assert statuses(jack.cell) == [(False, "no_error"), (True, "up"), (True, "down"), (False, "no_error")]
    assert jack.cell.jack.progress == 0.0 and codes(jack.cell) == []


def test_a_move_posted_meanwhile_waits_for_the_whole_self_check(jack: Stroke) -> None:
    jack.cell.ask(JackSelfCheck())
    move = jack.cell.create()
    jack.tick(20)
    assert jack.cell.planning().message == "the jack is moving down; the move starts when it has arrived"
    jack.tick(10)
    assert (jack.cell.get(move.id).state, jack.cell.planning().message) == ("moving", "")
    assert jack.cell.script.steps > 0


def test_an_emergency_stop_holds_a_self_check(jack: Stroke) -> None:
    jack.cell.ask(JackSelfCheck())
    jack.tick(5)
    jack.cell.ask(SetEmergencyStop(enable=True))
    jack.tick(1)
    held = jack.cell.jack
    jack.tick(20)
    assert held is not None and jack.cell.jack is not None
    assert jack.cell.jack.progress == held.progress and last(jack.cell).jack_checking
    jack.cell.ask(SetEmergencyStop(enable=False))
    jack.tick(30)
    assert (last(jack.cell).jack_checking, last(jack.cell).jack_check) == (False, "no_error")


def test_a_self_check_that_lifts_something_lowers_it_again_and_fails(jack: Stroke) -> None:
    jack.weight = 90.0
    jack.cell.ask(JackSelfCheck())
    jack.tick(30)
    assert jack.cell.jack is not None and jack.cell.jack.progress == 0.0
    assert last(jack.cell).jack_check == "error" and codes(jack.cell) == [12004]
    assert last(jack.cell).alerts[0].msg == (
        "the self-check of the jack failed: 90 kg are on the jack, want less than 5 kg"
    )


def test_a_jack_that_gets_stuck_fails_its_self_check_until_the_error_is_cleared(jack: Stroke) -> None:
    jack.stuck_at = 0.4
    jack.cell.ask(JackSelfCheck())
    jack.tick(TIME_LIMIT_NS // STEP + 5)
    assert last(jack.cell).jack_check == "error" and codes(jack.cell) == [12004]
    assert jack.cell.ask(ClearJackErrors()).detail.startswith(
        "cleared: the self-check of the jack failed: the jack did"
    )
    assert last(jack.cell).jack_check == "no_error" and codes(jack.cell) == []
    assert jack.cell.ask(ClearJackErrors()).detail == "no error of the jack"


def test_an_order_that_did_not_arrive_is_cleared_too(jack: Stroke) -> None:
    jack.stuck_at = 0.4
    jack.cell.ask(JackRequest(direction="up"))
    jack.tick(TIME_LIMIT_NS // STEP + 5)
    assert codes(jack.cell) == [9016]
    jack.cell.ask(ClearJackErrors())
    assert codes(jack.cell) == []


def test_an_order_interrupts_a_self_check(jack: Stroke) -> None:
    jack.cell.ask(JackSelfCheck())
    jack.tick(5)
    jack.cell.ask(JackRequest(direction="down"))
    jack.tick(20)
    assert (last(jack.cell).jack_checking, last(jack.cell).jack_check) == (False, "unknown")


def test_a_self_check_needs_the_jack_down_nothing_above_and_no_move(jack: Stroke) -> None:
    cell = jack.cell

    def refused(text: str) -> None:
        with pytest.raises(RequestRefused, match=text) as error:
            cell.ask(JackSelfCheck())
        assert error.value.code is RefusalCode.PRECONDITION
        assert not last(cell).jack_checking

    move = cell.create()
    refused(f"move {move.id} is running")
    cell.cancel()
    cell.jack = Jack(stamp=0, state="hold", progress=0.5, weight=0.0)
    cell.tick()
    refused("the jack is at 50%; lower it first")
    cell.jack = Jack(stamp=0, state="hold", progress=1.0, weight=90.0)
    cell.tick()
    refused("carrying a rack; the jack must move freely")
    cell.jack = Jack(stamp=0, state="hold", progress=0.0, weight=0.0)
    cell.tick()
    refused("under a rack; the jack must move freely")


def test_a_jack_that_stalls_ends_its_order_and_says_under_what() -> None:
    def at(progress: float, stalled: bool = False) -> Jack:
        return Jack(stamp=0, state="hold", progress=progress, weight=345.2, stalled=stalled)

    orders = JackOrders()
    orders.request("up", at(0.0))
    assert orders.command(at(0.3), 0, allowed=True) == "up" and orders.failed is None
    assert orders.command(at(0.46, stalled=True), STEP, allowed=True) == "hold"
    assert orders.active is None
    assert orders.failed == "the jack stalled at 46% of its stroke under 345 kg: too heavy"
    orders.request("down", at(0.46))
    assert orders.command(at(0.46), 2 * STEP, allowed=True) == "down" and orders.failed is None
