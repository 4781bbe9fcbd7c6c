"""Rules of driving into a lift: each time limit and what ends it, on views that are given."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.services.planner.control.lift_entry import Entry, EntryRules, LiftView
from rackhand.services.planner.errors import MoveFailed

TICK = 0.04
FREE: dict[str, Any] = {"where": "outside", "point": "free", "door": "open", "away": 2.4, "standing": 0.0}


class Run:
    """Rules and their time, in seconds."""

    def __init__(self) -> None:
        self.rules, self.now = EntryRules(), 0.0

    def see(self, seconds: float = TICK, **view: Any) -> Entry:
        """That view for so long; what follows in the end."""
        entry = Entry()
        for _ in range(round(seconds / TICK)):
            entry = self.rules.decide(LiftView(stamp=round(self.now * NANOSECONDS), **FREE | view))
            self.now += TICK
        return entry

    def fails(self, within: float, **view: Any) -> tuple[Reason, float]:
        """The reason with which that view fails the move, and after how many seconds."""
        begun = self.now
        with pytest.raises(MoveFailed) as failed:
            self.see(within, **view)
        return failed.value.reason, self.now - begun


def test_it_drives_while_nothing_is_in_the_way() -> None:
    assert Run().see(60.0) == Entry(drive=True, arrived=False, notice="")


@pytest.mark.parametrize(
    ("view", "reason", "after"),
    [
        ({"door": "closed"}, Reason.ELEVATOR_CLOSED, 3.0),
        ({"point": "obscured"}, Reason.ELEVATOR_POINT_OBSCURED_TIMEOUT, 20.0),
        ({"point": "unknown"}, Reason.ELEVATOR_POINT_OCCUPANCY_DETECTION_TIMEOUT, 10.0),
        ({"standing": 10.1}, Reason.ELEVATOR_ENTER_PROGRESS_UPDATE_TIMEOUT, 0.0),
    ],
)
def test_each_limit(view: dict[str, Any], reason: Reason, after: float) -> None:
    run = Run()
    if after:
        waits = run.see(after - 0.2, **view)
        assert not waits.drive and waits.notice, "it stops, and says why"
    failed, lasted = run.fails(1.0, **view)
    assert failed is reason and lasted <= (0.4 if after else 0.0)


def test_a_door_that_closes_behind_the_chassis_is_not_waited_for() -> None:
    for where in ("in_doorway", "inside"):
        assert Run().see(10.0, where=where, door="closed").drive


def test_a_door_that_is_closing_stops_the_chassis_but_does_not_count_as_closed() -> None:
    run = Run()
    assert run.see(10.0, door="closing") == Entry(drive=False, notice="the lift's door is closing")
    assert run.see(2.8, door="closed").notice == "the lift's door is closed"
    assert run.see(door="open").drive
    assert run.see(2.8, door="closed").drive is False, "another 3 s"


def test_an_occupied_place_stops_it_for_three_seconds_and_then_it_goes_on_and_says_so() -> None:
    run = Run()
    assert run.see(2.9, point="occupied") == Entry(drive=False, notice="the place in the lift is occupied")
    goes_on = run.see(1.0, point="occupied")
    assert goes_on.drive and "as far as there is room" in goes_on.notice
    assert run.see(9.0, point="occupied", standing=9.9).drive
    assert run.fails(TICK, point="occupied", standing=10.1)[0] is Reason.ELEVATOR_POINT_OCCUPIED
    run.see(point="free")
    assert not run.see(2.9, point="occupied").drive, "one who comes later is waited for again"


def test_hidden_and_unknown_times_add_up_until_the_place_is_seen() -> None:
    run = Run()
    for _ in range(4):
        run.see(2.4, point="unknown")
        run.see(2.4, point="obscured")
    assert run.fails(1.0, point="unknown")[0] is Reason.ELEVATOR_POINT_OCCUPANCY_DETECTION_TIMEOUT
    run = Run()
    for _ in range(8):
        run.see(8.0, point="unknown")
        assert run.see(point="free").drive


def test_no_progress_is_announced_after_three_seconds() -> None:
    run = Run()
    assert run.see(standing=2.9).notice == ""
    assert run.see(standing=3.1) == Entry(drive=True, notice="no progress into the lift")


def test_within_20_cm_it_has_arrived_when_it_gets_no_nearer() -> None:
    for point in ("free", "occupied"):
        run = Run()
        run.see(3.2, where="inside", away=0.19, point=point)
        assert not run.see(where="inside", away=0.19, standing=2.9, point=point).arrived
        assert run.see(where="inside", away=0.19, standing=3.1, point=point).arrived
        assert not run.see(where="inside", away=0.21, standing=3.1, point=point).arrived
        assert not run.see(where="in_doorway", away=0.19, standing=3.1, point=point).arrived, "doors would close on it"


def test_after_a_hold_all_times_count_anew() -> None:
    run = Run()
    for view in ({"door": "closed"}, {"point": "unknown"}, {"point": "occupied"}):
        run.see(2.9, **view)
        run.now += 100.0
        run.rules.restart()
        assert not run.see(2.9, **view).drive
