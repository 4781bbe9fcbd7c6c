"""Decisions of a lift's controller, with doors that move as they are told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.lift import (
    HOLD,
    PATIENCE,
    CallLift,
    GetLift,
    GoToFloor,
    HoldDoor,
    LiftRequest,
    LiftState,
    ReleaseLift,
)
from rackhand.schemas.refusal import RequestRefused
from rackhand.services.sim.lift.controller import LiftController
from rackhand.services.sim.lift.traffic import CLIENT, Traffic

STEP = 20_000_000
DOOR_TIME, TRAVEL = 3.0, 8.0


class Run:
    """A lift over time. ``seen``: each state in which something changed but the opening."""

    def __init__(self, floors: tuple[str, ...] = ("one", "two", "three")) -> None:
        self.lift = LiftController(floors, round(TRAVEL * NANOSECONDS))
        self.stamp, self.opening, self.blocked = 0, 0.0, False
        self.arrivals: list[str] = []

    @property
    def now(self) -> float:
        return self.stamp / NANOSECONDS

    @property
    def state(self) -> LiftState:
        return self.lift.state(self.stamp)

    def ask(self, request: Any) -> LiftState:
        return self.lift.handle(LiftRequest(request=request), self.stamp)

    def wait(self, seconds: float) -> LiftState:
        for _ in range(round(seconds * NANOSECONDS / STEP)):
            self.stamp += STEP
            way = 0.02 / DOOR_TIME * (1 if self.lift.doors_open else -1)
            self.opening = min(max(self.opening + way, 0.0), 1.0)
            if self.lift.step(self.stamp, self.opening, self.blocked) == "arrive":
                assert self.opening == 0.0, "it rides with closed doors only"
                self.arrivals.append(self.lift.floor)
        return self.state

    def until(self, within: float = 60.0, **wanted: Any) -> float:
        """Wait for this state; the seconds that it took."""
        begun = self.now
        while any(getattr(self.state, name) != value for name, value in wanted.items()):
            assert self.now < begun + within, f"{self.state} is not {wanted}"
            self.wait(0.02)
        return self.now - begun


def call(floor: str, client: str = "amr1") -> CallLift:
    return CallLift(client=client, floor=floor)


def go(floor: str, client: str = "amr1") -> GoToFloor:
    return GoToFloor(client=client, floor=floor)


def test_a_ride_from_call_to_release() -> None:
    run = Run()
    assert run.ask(call("one")).holder == "amr1"
    assert run.until(door="open") == pytest.approx(DOOR_TIME, abs=0.1)
    state = run.ask(go("two"))
    assert (state.target, state.moving, state.door) == ("two", False, "open")
    assert run.until(moving=True) == pytest.approx(DOOR_TIME, abs=0.2)
    assert (run.state.door, run.state.opening, run.state.floor) == ("closed", 0.0, "one")
    assert run.until(floor="two") == pytest.approx(TRAVEL, abs=0.1)
    run.until(door="open")
    assert (run.state.target, run.state.holder) == (None, "amr1")
    run.ask(ReleaseLift(client="amr1"))
    assert run.state.holder is None and run.state.door == "open"
    assert run.until(door="closing") == pytest.approx(HOLD, abs=0.1)


def test_it_comes_from_another_floor_and_stops_at_none_between() -> None:
    run = Run()
    run.ask(call("three"))
    run.until(floor="three", door="open")
    assert run.arrivals == ["two", "three"] and run.now == pytest.approx(2 * TRAVEL + DOOR_TIME, abs=0.3)


def test_doors_close_by_themselves_unless_they_are_held() -> None:
    run = Run()
    run.ask(call("one"))
    run.until(door="open")
    for _ in range(5):
        run.wait(HOLD - 1)
        run.ask(HoldDoor(client="amr1"))
    assert run.state.door == "open"
    assert run.until(door="closing") == pytest.approx(HOLD, abs=0.1)
    run.ask(HoldDoor(client="amr1"))
    run.until(door="opening", within=0.1)


def test_doors_never_close_on_what_is_between_them() -> None:
    run = Run()
    run.ask(call("one"))
    run.until(door="open")
    run.blocked = True
    run.ask(go("two"))
    run.wait(30)
    assert (run.state.door, run.state.blocked, run.state.target) == ("open", True, "two")
    run.blocked = False
    run.until(door="closing", within=0.1)
    run.wait(1.0)
    run.blocked = True
    run.wait(0.04)
    assert run.state.door == "opening"
    run.blocked = False
    run.until(floor="two", door="open")


def test_calls_are_served_in_their_order_and_can_be_changed_and_taken_back() -> None:
    run = Run()
    run.ask(call("one", "a"))
    assert run.ask(call("two", "b")).waiting == ("b",)
    run.ask(call("two", "c"))
    run.ask(call("three", "b"))
    assert run.ask(call("one", "d")).waiting == ("b", "c", "d")
    run.ask(ReleaseLift(client="c"))
    run.until(door="open")
    run.ask(ReleaseLift(client="a"))
    run.wait(0.02)
    assert (run.state.holder, run.state.waiting) == ("b", ("d",))
    run.until(floor="three", door="open")


def test_one_who_does_not_have_it_is_refused() -> None:
    run = Run()
    for request in (HoldDoor(client="b"), go("two", "b")):
        with pytest.raises(RequestRefused, match="'b' does not have the lift: nobody has it; call it first"):
            run.ask(request)
    run.ask(call("one", "a"))
    with pytest.raises(RequestRefused, match="'b' does not have the lift: 'a' has it"):
        run.ask(go("two", "b"))
    with pytest.raises(RequestRefused, match="floor 'four' is not known; known: \\['one', 'three', 'two'\\]"):
        run.ask(call("four", "b"))
    assert run.ask(GetLift()).holder == "a"


def test_a_client_that_says_nothing_more_loses_it_but_not_on_a_ride() -> None:
    run = Run()
    run.ask(call("one", "dead"))
    run.ask(call("two", "b"))
    assert run.until(holder="b", within=PATIENCE + 5) == pytest.approx(PATIENCE, abs=1.0)
    run.until(floor="two", door="open")


def test_a_call_during_a_ride_waits_for_its_end() -> None:
    run = Run()
    run.ask(call("two"))
    run.until(moving=True)
    run.wait(1.0)
    assert run.ask(call("one")).target == "one"
    run.until(floor="one", door="open")
    assert run.arrivals == ["two", "one"]


def test_doors_that_are_shut_by_a_fault_stay_shut_until_it_ends() -> None:
    run = Run()
    run.ask(call("one"))
    run.until(door="open")
    run.blocked = True
    run.lift.shut(True)
    run.wait(0.04)
    assert run.state.door == "closing"
    run.wait(DOOR_TIME + 0.5)
    run.ask(call("one"))
    run.ask(go("two"))
    run.wait(10.0)
    assert (run.state.door, run.state.moving) == ("closed", False)
    run.blocked = False
    run.lift.shut(False)
    run.until(floor="two", door="open")
    run.lift.shut(True)
    run.until(door="closed")
    run.ask(call("two"))
    run.wait(5.0)
    assert run.state.door == "closed"
    run.lift.shut(False)
    run.until(door="open", within=DOOR_TIME + 0.5)


def test_a_lift_that_is_taken_is_given_back_when_the_fault_ends() -> None:
    run = Run()
    run.ask(call("one", "a"))
    run.until(door="open")
    run.lift.take(True, run.stamp)
    assert (run.state.holder, run.state.waiting) == ("others", ("a",))
    with pytest.raises(RequestRefused, match="'others' has it"):
        run.ask(HoldDoor(client="a"))
    run.wait(PATIENCE + 5)
    assert run.state.holder == "others", "they say nothing and keep it"
    run.lift.take(False, run.stamp)
    run.wait(0.04)
    assert run.state.holder == "a"
    run.until(door="open")


def test_others_ride_now_and_then_by_the_seed() -> None:
    def rides(seed: int, per_minute: float) -> list[tuple[float, str]]:
        run, found = Run(), []
        traffic = Traffic(("one", "two", "three"), per_minute, np.random.default_rng(seed))
        for _ in range(60 * 50 * 20):
            request = traffic.ask(run.state)
            if request is not None:
                run.lift.handle(request, run.stamp)
                found.append((run.now, request.request.op))
            run.wait(0.02)
        assert run.state.holder in (None, CLIENT)
        return found

    one = rides(1, 1.0)
    assert [op for _, op in one[:6]] == ["call", "go", "release", "call", "go", "release"]
    assert 5 <= len(one) / 3 <= 22, "once a minute between rides of half a minute"
    assert one == rides(1, 1.0) and one != rides(2, 1.0) and rides(1, 0.0) == []
