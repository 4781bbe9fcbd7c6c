"""Whom a simulator is asked to wait for, and when."""

from __future__ import annotations

from typing import Any

from rackhand.runtime.lockstep import SIMULATOR, LockstepParticipant
from rackhand.schemas import topics
from rackhand.schemas.service import ServiceId
from tests.runtime.list_bus import ListBus

PERIOD = 40_000_000


def participant(bus: Any) -> LockstepParticipant:
    return LockstepParticipant(bus, ServiceId("planner", "amr1"), PERIOD)


def test_a_simulator_is_joined_once_in_each_run() -> None:
    bus = ListBus()
    lockstep = participant(bus)
    lockstep.presence(SIMULATOR, True)
    lockstep.clock("a")
    lockstep.join_if_due()
    lockstep.clock("a")
    lockstep.join_if_due()
    ((query, join),) = bus.calls
    assert query is topics.WORLD_CONTROL
    assert (join.robot, join.service, join.period_ns) == ("amr1", "planner", PERIOD)
    lockstep.clock("b")
    lockstep.join_if_due()
    assert len(bus.calls) == 2, "after a reset"
    lockstep.presence(SIMULATOR, False)
    lockstep.join_if_due()
    lockstep.presence(SIMULATOR, True)
    lockstep.clock("c")
    lockstep.join_if_due()
    lockstep.join_if_due()
    assert len(bus.calls) == 3, "another simulator"


def test_a_real_robot_is_not_asked() -> None:
    bus = ListBus()
    lockstep = participant(bus)
    lockstep.presence(ServiceId("driver", "amr1"), True)
    for run in ("boot", "another boot"):
        lockstep.clock(run)
        lockstep.join_if_due()
    assert bus.calls == []


def test_a_simulator_that_does_not_answer_is_asked_again() -> None:
    bus = ListBus(unavailable=2)
    lockstep = participant(bus)
    lockstep.presence(SIMULATOR, True)
    for _ in range(4):
        lockstep.join_if_due()
    assert len(bus.calls) == 3


def test_who_has_lost_its_driver_joins_again_when_it_is_back() -> None:
    bus, driver = ListBus(), ServiceId("driver", "amr1")
    lockstep = participant(bus)
    lockstep.presence(SIMULATOR, True)
    lockstep.presence(driver, True)
    lockstep.join_if_due()
    lockstep.presence(ServiceId("driver", "amr2"), False)
    lockstep.presence(driver, False)
    lockstep.join_if_due()
    assert len(bus.calls) == 1
    lockstep.presence(driver, True)
    lockstep.join_if_due()
    lockstep.join_if_due()
    assert len(bus.calls) == 2
