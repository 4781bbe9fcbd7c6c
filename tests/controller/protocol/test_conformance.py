"""The conformance vectors of spec motion-controller §10, by their numbers, on the layer without transport."""

from __future__ import annotations

import pytest

from rackhand.schemas.motion import FencingToken
from rackhand.services.controller.access.streams import StreamGuard, StreamSample
from tests.controller.protocol.bench import BAD, OK, PATH, Bench


def test_1_lock() -> None:
    answer = Bench().ask("a", command="lockControl", priority=10, id=1)
    assert answer == {"command": "reply", "replyCommand": "lockControl", "message": True, "id": 1}


@pytest.mark.parametrize(("strict", "message"), [(True, {"code": 403, "detail": 0}), (False, OK)])
def test_2_another_client(strict: bool, message: object) -> None:
    bench = Bench(strict_crf=strict)
    bench.ask("a", command="lockControl", priority=10)
    assert bench.ask("b", command="lockControl", priority=20)["message"] is False
    answer = bench.ask("b", command="softStop", priority=20)
    assert (answer["replyCommand"], answer["message"]) == ("softStop", message)


def test_3_a_path() -> None:
    bench = Bench()
    assert bench.ask("a", **PATH) == {"command": "reply", "replyCommand": "appendPath", "message": OK}
    assert bench.queue == [(0, 0, 0, 0, 0, 0)]


def test_4_wrong_counts_in_two_layers() -> None:
    bench = Bench()
    answer = bench.ask("a", **{**PATH, "data": [[0, 0, 0, 0, 0]]})
    assert (answer["replyCommand"], answer["message"]) == ("appendPath", BAD)
    assert answer["text"] == "data[0] has 5 numbers, the arm 6 joints"
    without = {key: value for key, value in PATH.items() if key != "priority"}
    answer = bench.ask("a", **without)
    assert (answer["replyCommand"], answer["message"]) == ("error", 400)
    answer = bench.ask("a", command="setVelocity", priority=10, type="joints", data=[0] * 5)
    assert (answer["replyCommand"], answer["message"]) == ("error", 400)
    assert bench.queue == [] and bench.dispatcher.access.priority_under_control == 0


def test_5_lock_without_a_valid_priority() -> None:
    bench = Bench()
    for request, text in (({"priority": 0}, "Priority not valid"), ({}, "Wrong parameters")):
        answer = bench.ask("a", command="lockControl", **request)
        assert (answer["replyCommand"], answer["message"]) == ("error", text)


def test_6_an_unknown_command() -> None:
    answer = Bench().ask("a", command="foo", id=7)
    assert answer == {"command": "reply", "replyCommand": "error", "message": "Unknown command: foo", "id": 7}


def test_7_streams() -> None:
    bench = Bench()
    for request, text in (
        ({"command": "startStreamStatus", "frequency": 0}, "Frequency not valid"),
        ({"command": "startStreamStatus", "frequency": 1.0, "mode": 0}, "Mode not valid"),
        ({"command": "stopStreamStatus"}, "Stream was not active"),
    ):
        answer = bench.ask("a", **request)
        assert (answer["replyCommand"], answer["message"]) == ("error", text)


def test_8_a_lock_runs_out() -> None:
    bench = Bench()
    bench.ask("a", command="lockControl", priority=1)
    bench.ask("a", **{**PATH, "priority": 1})
    assert bench.ask("b", command="getStatus")["message"]["priorityUnderControl"] == 1
    bench.wait(10.01)
    assert bench.ask("b", command="getStatus")["message"]["priorityUnderControl"] == 0
    assert bench.ask("a", command="unlockControl", priority=1)["message"] is False
    assert bench.queue == [], "the arm was stopped"


def test_9_a_command_this_controller_does_not_offer() -> None:
    bench = Bench(not_offered=frozenset({"setVelocity"}))
    answer = bench.ask("a", command="setVelocity", priority=10, type="joints", data=[0] * 6)
    assert answer["message"] == {"code": 405, "detail": 0}


def test_10_silence_ends_a_velocity() -> None:
    bench, guard = Bench(), StreamGuard()
    answer = bench.ask("a", command="setVelocity", priority=10, type="joints", data=[0.1] * 6)
    assert answer["message"] == OK
    granted = bench.turn.granted
    assert granted and isinstance(granted.decision.token, FencingToken)
    guard.offer(StreamSample(granted.decision.token), 0)
    assert not guard.expired(99_000_000) and guard.expired(100_000_000)
