"""Long requests are read beside the loop: no tick waits for one, order holds, and a stop is faster."""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any

import pytest

from rackhand.services.controller.protocol.dispatch import Dispatcher
from rackhand.services.controller.protocol.reading import LONG, MAX_WAITING
from tests.controller.cell import UR5E, PerfectArm

NEAR = (UR5E.home + 0.01).tolist()
PATH: dict[str, Any] = {"command": "appendPath", "priority": 10, "type": "joints", "data": [NEAR] * 200}
OK = {"value": True, "code": 200, "detail": 0}


class Later(Executor):
    """Does what it is given when it is told to."""

    def __init__(self) -> None:
        self._given: list[Callable[[], None]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self._given.append(lambda: future.set_result(fn(*args, **kwargs)))
        return future

    def work(self) -> None:
        given, self._given = self._given, []
        for do in given:
            do()


@pytest.fixture
def reader() -> Later:
    return Later()


@pytest.fixture
def arm(reader: Later) -> PerfectArm:
    return PerfectArm(lockstep=False, reader=reader)


def send(arm: PerfectArm, session: str, **request: Any) -> int:
    return arm.send(session, json.dumps(request))


def test_the_loop_runs_while_a_long_request_is_read(arm: PerfectArm, reader: Later) -> None:
    path = send(arm, "a", **PATH)
    arm.advance(0.1)
    assert path not in arm.answers and arm.controller.busy
    reader.work()
    arm.advance(0.008)
    assert arm.answers[path]["message"] == OK


def test_a_short_request_waits_for_its_sessions_long_one_and_for_no_other(arm: PerfectArm, reader: Later) -> None:
    path = send(arm, "a", **PATH)
    mine = send(arm, "a", command="unlockControl", priority=10)
    other = send(arm, "b", command="getStatus")
    assert other in arm.answers and mine not in arm.answers
    reader.work()
    arm.advance(0.008)
    assert arm.answers[path]["message"] == OK and arm.answers[mine]["message"] is True


@pytest.mark.parametrize("stopper", ["a", "b"])
def test_a_stop_is_faster_and_what_it_overtook_moves_nothing(arm: PerfectArm, reader: Later, stopper: str) -> None:
    path = send(arm, "a", **PATH, id=5)
    stop = arm.send(stopper, '{"command":"softStop"}', stop=True)
    assert arm.answers[stop]["message"] == OK
    reader.work()
    arm.advance(0.1)
    assert (arm.answers[path]["replyCommand"], arm.answers[path]["message"], arm.answers[path]["id"]) == (
        "error",
        409,
        5,
    )
    assert arm.controller.motion.standing and arm.controller.access.priority_under_control == 0


def test_who_has_gone_moves_nothing_any_more(arm: PerfectArm, reader: Later) -> None:
    send(arm, "a", **PATH)
    arm.controller.disconnected("a")
    reader.work()
    arm.advance(0.1)
    assert arm.controller.motion.standing and arm.controller.access.priority_under_control == 0


def test_in_lockstep_the_tick_waits_so_that_runs_are_the_same() -> None:
    with ThreadPoolExecutor(1) as pool:
        arm = PerfectArm(reader=pool)
        path = send(arm, "a", **PATH)
        arm.advance(0.004)
        assert path in arm.answers or arm.controller.planning
        assert arm.controller.busy == arm.controller.planning, "nothing is left to be read"


def test_one_that_fails_is_reported_so_and_takes_nobody_with_it(
    arm: PerfectArm, reader: Later, monkeypatch: pytest.MonkeyPatch
) -> None:
    lost, other = send(arm, "a", **PATH), send(arm, "b", **{**PATH, "priority": 5})
    real = Dispatcher.request

    def fails(dispatcher: Dispatcher, session: str, *rest: Any) -> Any:
        if session == "a":
            raise RuntimeError("a bug")
        return real(dispatcher, session, *rest)

    monkeypatch.setattr(Dispatcher, "request", fails)
    reader.work()
    arm.advance(0.008)
    assert arm.answers[lost]["message"] == 500 and arm.answers[other]["message"] == OK
    assert [str(error) for error in arm.errors] == ["a bug"]


def test_no_more_are_read_than_there_is_room_for(arm: PerfectArm, reader: Later) -> None:
    tickets = [send(arm, f"s{i}", command="getStatus", pad="x" * LONG) for i in range(MAX_WAITING + 1)]
    assert [ticket for ticket in tickets if ticket in arm.answers] == tickets[-1:]
    assert arm.answers[tickets[-1]]["message"] == 503
    reader.work()
    arm.advance(0.004)
    assert all(ticket in arm.answers for ticket in tickets)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"command":"getStatus","id":[' + "1," * 100_000 + "1]}", "Not valid json format"),
        ('{"command":"setParameters","priority":10,"data":{"Controller":{"a":[' + "1," * 99_999 + "1]}}}",
         "Not valid json format"),
        ('{"command":"setVelocity","priority":10,"type":"joints","data":[' + "0," * 99_999 + "0]}",
         "Not valid json format"),
        ('{"command":"appendPath","priority":10,"type":"joints","data":"' + "x" * 100_000 + '"}', 400),
        ('{"message":{"command":"appendPath","priority":10,"type":"joints","data":[' + "[0]," * 3000 + "[0]]}}", 413),
        ("[" + "0," * 100_000 + "0]", "Cannot get command field from received json"),
        ("[" + "0," * 100_000 + "nope]", "Not valid json format"),
        ('{"command":"softStop","pad":"' + "x" * LONG + '"}', "Not valid json format"),
    ],
)  # fmt: skip
def test_what_would_take_longer_than_a_period_is_not_even_turned_into_values(text: str, message: Any) -> None:
    arm = PerfectArm()
    ticket = arm.send("a", text, stop="softStop" in text)
    arm.advance(0.004)
    found = arm.answers[ticket]["message"]
    assert (found["code"] if isinstance(found, dict) else found) == message
    assert arm.answers[ticket]["text"]
