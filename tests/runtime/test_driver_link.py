"""Which measurements are answered, and how a driver that disconnects, falls silent or restarts is noticed."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.runtime.driver_link import SILENCE, DriverLink
from rackhand.schemas.world import Clock

MS = 1_000_000


def new_link() -> DriverLink:
    return DriverLink("the driver", 40 * MS)


def clock(run: str, stamp: int = 0, **more: Any) -> Clock:
    fields = {"step_ns": MS, "speed": None, "paused": False, "lockstep": False, "unix_ns": 0} | more
    return Clock(stamp=stamp, run=run, **fields)


def test_every_period_is_answered_once_and_a_repeated_measurement_again() -> None:
    link = new_link()
    stamps = [0, 0, 20, 40, 60, 60, 80, 140, 160]
    answers = [link.due(stamp * MS) for stamp in stamps]
    assert answers == ["tick", "repeat", "skip", "tick", "skip", "skip", "tick", "tick", "tick"]
    link.presence(True, 0.0)
    link.presence(False, 0.0)
    assert link.due(160 * MS) == "tick", "of another run"


def test_a_driver_that_disconnects_and_comes_back() -> None:
    link = new_link()
    assert link.fault == "the driver is not connected"
    assert link.presence(True, 0.0) is None
    assert link.alive
    assert link.clock(clock("a", lockstep=True), 0.0) is None
    assert link.measured("odometry", 80 * MS, 0.0) is None
    assert link.presence(False, 0.1) == "the driver disconnected"
    assert link.fault == "the driver disconnected"
    assert link.measured("odometry", 100 * MS, 0.1) is None
    assert not link.alive, "a late sample does not bring it back"
    assert not link.lockstep
    assert link.presence(True, 0.2) is None
    assert link.alive
    assert link.clock(clock("b"), 0.2) is None, "all measurements were void already"


def test_a_reset_is_noticed_once() -> None:
    link = new_link()
    link.presence(True, 0.0)
    link.clock(clock("a"), 0.0)
    link.measured("contacts", 100 * MS, 0.0)
    link.measured("odometry", 120 * MS, 0.0)
    assert link.measured("contacts", 0, 0.0) == "the driver restarted"
    assert link.measured("odometry", 0, 0.0) is None, "known by then"
    assert link.due(0) == "tick"
    assert link.clock(clock("b"), 0.0) is None


def test_a_reset_that_only_the_clock_shows() -> None:
    link = new_link()
    link.presence(True, 0.0)
    link.clock(clock("a"), 0.0)
    link.measured("odometry", 0, 0.0)
    assert link.measured("odometry", 0, 0.0) is None, "a measurement that is published again is no reset"
    assert link.clock(clock("a", 20), 0.0) is None
    assert link.clock(clock("b"), 0.0) == "the driver restarted"


def test_a_driver_without_a_token_is_alive_while_it_publishes() -> None:
    link = new_link()
    link.measured("odometry", 5, 10.0)
    assert link.alive
    assert link.check(10.0 + SILENCE - 0.01) is None
    assert link.seconds_left(10.0 + SILENCE - 0.25) == pytest.approx(0.25)
    assert link.check(10.0 + SILENCE) == "the driver sent no measurement for 1.5 s"
    assert link.fault == "the driver sent no measurement for 1.5 s"
    assert link.check(20.0) is None, "said once"
    assert link.seconds_left(20.0) is None
    assert link.measured("odometry", 5, 21.0) is None
    assert link.alive


@pytest.mark.parametrize("token", [True, False])
def test_a_driver_that_falls_silent_and_one_that_never_measured_anything(token: bool) -> None:
    link = new_link()
    if token:
        link.presence(True, 3.0)
    else:
        link.measured("odometry", 0, 3.0)
    assert link.check(3.0 + SILENCE - 0.1) is None
    assert link.check(3.0 + SILENCE) is not None
    assert link.presence(False, 5.0) == "the driver disconnected"


def test_a_localiser_s_pose_is_no_sign_of_life_of_the_driver() -> None:
    link = new_link()
    link.measured("odometry", 0, 0.0)
    link.measured("pose", 900 * MS, 0.9, from_driver=False)
    assert link.check(SILENCE) is not None
    link.measured("pose", 1000 * MS, SILENCE, from_driver=False)
    assert not link.alive


def test_a_paused_world_is_alive_while_it_publishes_its_clock_and_gets_time_to_go_on() -> None:
    link = new_link()
    link.measured("odometry", 0, 0.0)
    for tenth in range(5, 100, 5):
        link.clock(clock("a", paused=True), tenth / 10)
        assert link.check(tenth / 10 + 0.4) is None
    assert link.clock(clock("a"), 10.0) is None
    assert link.check(10.0 + SILENCE - 0.1) is None
    link.clock(clock("a"), 10.0 + SILENCE - 0.05)
    assert link.check(10.0 + SILENCE) is not None, "the clock of a world that runs is no measurement"


def test_a_slow_world_is_given_time_in_proportion() -> None:
    link = new_link()
    link.measured("odometry", 0, 0.0)
    link.clock(clock("a", speed=0.01), 0.0)
    assert link.check(100 * SILENCE - 1.0) is None
    assert link.check(100 * SILENCE) == "the driver sent no measurement for 150.0 s"
    link.measured("odometry", 0, 200.0)
    link.clock(clock("a", speed=50.0), 200.0)
    assert link.check(200.0 + SILENCE - 0.1) is None
    assert link.check(200.0 + SILENCE) is not None


def test_in_lockstep_only_the_token_counts() -> None:
    """The world waits for whoever takes long, and a run must not depend on the machine's clock."""
    link = new_link()
    link.presence(True, 0.0)
    link.clock(clock("a", lockstep=True), 0.0)
    link.measured("odometry", 0, 0.0)
    assert link.seconds_left(500.0) is None
    assert link.check(1000.0) is None
    assert link.presence(False, 1000.0) is not None


def test_a_reset_after_a_silence_is_noticed_by_the_clock() -> None:
    link = new_link()
    link.clock(clock("a"), 0.0)
    link.measured("odometry", 0, 0.0)
    assert link.check(SILENCE) is not None
    link.measured("odometry", 40 * MS, 2.0)
    assert link.clock(clock("a"), 2.0) is None
    assert link.clock(clock("b"), 2.1) == "the driver restarted"
