"""What the controller makes of a driver that comes, goes, and begins anew."""

from __future__ import annotations

from schemas.world import Clock
from services.controller.driver_link import DriverLink

PERIOD = 4_000_000


def clock(run: str, lockstep: bool = True) -> Clock:
    return Clock(stamp=0, run=run, step_ns=1, speed=None, paused=False, lockstep=lockstep, unix_ns=0)


def test_the_first_state_of_each_period_is_answered_and_one_told_again_too() -> None:
    link = DriverLink(PERIOD)
    asked = [link.asks(stamp * 1_000_000) for stamp in (0, 2, 4, 4, 6, 9, 10, 12)]
    assert asked == ["tick", "skip", "tick", "repeat", "skip", "tick", "skip", "tick"]


def test_another_run_is_told_once_whichever_tells_of_it_first() -> None:
    for stamp_first in (True, False):
        link = DriverLink(PERIOD)
        assert link.presence(True) is None
        assert link.clock(clock("a")) is None
        assert link.state(8 * PERIOD) is None
        link.needs_join = False
        events = [lambda link=link: link.state(0), lambda link=link: link.clock(clock("b"))]
        told = [event() for event in (events if stamp_first else reversed(events))]
        assert [text is not None for text in told] == [True, False]
        assert link.needs_join, "the new run does not know of it"
        assert link.asks(0) == "tick"


def test_a_driver_that_has_gone_is_joined_again_when_it_is_back() -> None:
    link = DriverLink(PERIOD)
    link.presence(True)
    link.clock(clock("a"))
    link.needs_join = False
    assert link.presence(False) is not None
    assert not link.needs_join and not link.lockstep
    assert link.presence(True) is None and link.needs_join


def test_a_real_robot_has_neither_clock_nor_presence() -> None:
    link = DriverLink(PERIOD)
    assert link.state(10**18) is None and link.asks(10**18) == "tick"
    assert not link.needs_join and not link.lockstep
