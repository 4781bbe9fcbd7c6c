"""Which instants are answered, and how a driver that went or began anew is noticed."""

from __future__ import annotations

from rackhand.runtime.driver_link import DriverLink
from rackhand.schemas.world import Clock

MS = 1_000_000


def new_link() -> DriverLink:
    return DriverLink("the driver", 40 * MS)


def clock(run: str, stamp: int = 0) -> Clock:
    return Clock(stamp=stamp, run=run, step_ns=MS, speed=None, paused=False, lockstep=True, unix_ns=0)


def test_every_period_is_answered_once_and_again_when_asked_again() -> None:
    link = new_link()
    stamps = [0, 0, 20, 40, 60, 60, 80, 140, 160]
    answers = [link.asks(stamp * MS) for stamp in stamps]
    assert answers == ["tick", "repeat", "skip", "tick", "skip", "skip", "tick", "tick", "tick"]
    link.presence(True)
    link.presence(False)
    assert link.asks(160 * MS) == "tick", "of another run"


def test_a_simulator_that_goes_and_comes_back_is_joined_again() -> None:
    link = new_link()
    assert not link.alive
    assert link.presence(True) is None
    assert (link.alive, link.needs_join) == (True, True)
    link.needs_join = False
    assert link.clock(clock("a")) is None
    assert link.sample("odometry", 80 * MS) is None
    assert link.presence(False) == "the driver has gone"
    assert link.sample("odometry", 100 * MS) is None
    assert not link.alive, "a straggler does not bring it back"
    assert not link.lockstep
    assert link.presence(True) is None
    assert link.needs_join
    link.needs_join = False
    assert link.clock(clock("b")) is None, "it was void already"
    assert not link.needs_join


def test_a_reset_is_noticed_once_and_joined_again() -> None:
    link = new_link()
    link.presence(True)
    link.clock(clock("a"))
    link.needs_join = False
    link.sample("contacts", 100 * MS)
    link.sample("odometry", 120 * MS)
    assert link.sample("contacts", 0) == "the driver began anew"
    assert link.sample("odometry", 0) is None, "known by then"
    assert link.asks(0) == "tick"
    assert link.clock(clock("b")) is None
    assert link.needs_join


def test_a_reset_that_only_the_clock_tells() -> None:
    link = new_link()
    link.presence(True)
    link.clock(clock("a"))
    link.needs_join = False
    link.sample("odometry", 0)
    assert link.sample("odometry", 0) is None, "an instant that is told again is no reset"
    assert link.clock(clock("a", 20)) is None
    assert link.clock(clock("b")) == "the driver began anew"
    assert link.needs_join


def test_a_real_robot_is_there_while_it_is_heard_and_never_joined() -> None:
    link = new_link()
    link.sample("odometry", 5)
    link.clock(clock("boot"))
    assert (link.alive, link.needs_join) == (True, False)
    link.clock(clock("reboot"))
    assert not link.needs_join
