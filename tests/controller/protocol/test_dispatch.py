"""Requests to answers: exact errors, aliases, leases, retries, streams; and what hostile clients send."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.motion import Expected, MotionEvent
from rackhand.schemas.orientation import Representation
from rackhand.services.controller.access.types import SECOND, StopMotion
from rackhand.services.controller.commands.settings import parameters_of
from rackhand.services.controller.protocol.answers import event
from rackhand.services.controller.protocol.sessions import alias
from rackhand.services.controller.protocol.status_stream import StatusStream
from tests.controller.protocol.bench import BAD, IDLE, OK, PATH, Bench

POSE = {"Position": [0.3, 0, 0.5], "Orientation": {"Quaternion": {"W": 1, "X": 0, "Y": 0, "Z": 0}}}
TASK_PATH = {"command": "appendPath", "priority": 10, "type": "task", "data": [POSE], "method": 2, "reference": 1}
VELOCITY = {"command": "setVelocity", "priority": 10, "type": "joints", "data": [0.1] * 6}
TASK_VELOCITY = {"command": "setVelocity", "priority": 10, "type": "task", "data": [0.1] * 6, "reference": 1}


def without(request: dict[str, Any], key: str) -> dict[str, Any]:
    return {k: v for k, v in request.items() if k != key}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "Not valid json format"),
        ("{", "Not valid json format"),
        ('{"command":"getStatus"} x', "Not valid json format"),
        ('{"command":"setVelocity","data":[NaN]}', "Not valid json format"),
        ('{"command":"setVelocity","data":[1e999]}', "Not valid json format"),
        (b"\xff\xfe", "Not valid json format"),
        ('{"command":"\\ud800"}', "Not valid json format"),
        ("[" * 100_000, "Not valid json format"),
        ('{"command":"getStatus","id":' + "[" * 500 + "]" * 500 + "}", "Not valid json format"),
        ("9" * 5000, "Not valid json format"),
        ("[]", "Cannot get command field from received json"),
        ("null", "Cannot get command field from received json"),
        ('{"command":7}', "Cannot get command field from received json"),
        ('{"priority":10}', "Cannot get command field from received json"),
        ('{"command":"getstatus"}', "Unknown command: getstatus"),
        ('{"command":"getStatus","user":"ann"}', "Unknown user fields: getStatus"),
        ('{"command":"getStatus","user":{"name":"ann"}}', "Unknown user fields: getStatus"),
        ('{"command":"lockControl","priority":"ten"}', "Wrong parameters"),
        ('{"command":"lockControl","priority":true}', "Wrong parameters"),
        ('{"command":"lockControl","priority":1.5}', "Wrong parameters"),
        ('{"command":"lockControl","priority":-3}', "Priority not valid"),
        ('{"command":"lockControl","priority":4294967296}', "Priority not valid"),
        ('{"command":"lockControl","priority":3,"keepAlive":0}', "Wrong parameters"),
        ('{"command":"unlockControl"}', "Wrong parameters"),
        ('{"command":"unlockControl","priority":0}', "Priority not valid"),
        ('{"command":"startStreamStatus"}', "Wrong parameters"),
        ('{"command":"startStreamStatus","frequency":"inf"}', "Frequency not valid"),
        ('{"command":"startStreamStatus","frequency":-1}', "Frequency not valid"),
        ('{"command":"startStreamStatus","frequency":1,"mode":3}', "Mode not valid"),
        ('{"command":"startHeartbeat","period":0}', "Heartbeat period not valid"),
        ('{"command":"startHeartbeat","period":"NaN"}', "Heartbeat period not valid"),
        ('{"command":"startHeartbeat"}', "Wrong parameters"),
        ('{"command":"heartbeat"}', "Heartbeat has not been configured"),
        ('{"command":"stopHeartbeat"}', "Heartbeat has not been configured"),
    ],
)
def test_errors_of_the_base_layer_to_the_letter(text: str | bytes, message: str) -> None:
    answer = Bench().send("a", text)
    assert (answer["replyCommand"], answer["message"]) == ("error", message)


@pytest.mark.parametrize(
    "request_",
    [
        without(PATH, "priority"),
        without(PATH, "type"),
        without(PATH, "data"),
        {**PATH, "priority": 0},
        {**PATH, "type": "joint"},
        {**PATH, "type": ["joints"]},
        {**PATH, "data": 5},
        {**PATH, "data": [["0"] * 6]},
        {**PATH, "data": [[True] * 6]},
        {**PATH, "data": [[10**400] * 6]},
        without(TASK_PATH, "method"),
        without(TASK_PATH, "reference"),
        {**TASK_PATH, "data": [{"data": [0] * 6, "representation": 5}]},
        {**TASK_PATH, "data": [{"Position": [0, 0], "Orientation": POSE["Orientation"]}]},
        {**TASK_PATH, "data": [{**POSE, "Orientation": {"Quaternion": {"W": 2, "X": 0, "Y": 0, "Z": 0}}}]},
        {**VELOCITY, "data": [0.1] * 7},
        {**TASK_VELOCITY, "data": [0.1] * 5},
        without(TASK_VELOCITY, "reference"),
        {**VELOCITY, "command": "setTorque", "data": []},
        {"command": "setParameters", "priority": 10},
        {"command": "setParameters", "priority": 10, "data": [1]},
        {"command": "setProfileVelocity", "priority": 10, "type": "task", "data": [1] * 7},
    ],
)
def test_a_malformed_command_is_a_bare_400(request_: dict[str, Any]) -> None:
    bench = Bench()
    answer = bench.ask("a", **request_, id="x")
    assert (answer["replyCommand"], answer["message"], answer["id"]) == ("error", 400, "x")
    assert answer["text"]
    assert bench.dispatcher.access.priority_under_control == 0


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        ({**PATH, "data": []}, "empty"),
        ({**PATH, "data": [["NaN"] * 6]}, "data[0][0] is nan rad"),
        ({**PATH, "data": [[0] * 6, [0, 0, 7, 0, 0, 0]]}, "data[1][2] is 7 rad, outside [-6.28, 6.28]"),
        ({**TASK_PATH, "method": 0}, "method 0"),
        ({**TASK_PATH, "reference": 3}, "reference 3"),
        ({**TASK_PATH, "data": [{**POSE, "Position": ["inf", 0, 0]}]}, "not finite"),
        ({**TASK_PATH, "data": [{"data": [0, 0, 0, "NaN", 0, 0], "representation": 1}]}, "not finite"),
        ({**VELOCITY, "data": [0, 0, 0, 0, 0, -3.15]}, "data[5] is -3.15, at most ±3.14"),
        ({**VELOCITY, "data": ["NaN"] * 6}, "data[0] is nan"),
        ({**VELOCITY, "timeout": 0}, "timeout"),
        ({**TASK_VELOCITY, "data": [1.1, 0, 0, 0, 0, 0]}, "data[0] is 1.1, at most ±1"),
        ({**TASK_VELOCITY, "reference": 0}, "reference 0"),
        ({**VELOCITY, "command": "setTorque", "data": [151] + [0] * 5}, "at most ±150"),
        ({**TASK_VELOCITY, "command": "setTorque", "data": ["inf"] + [0] * 5}, "data[0] is inf"),
        ({"command": "setProfileVelocity", "priority": 10, "type": "joints", "data": [1] * 5}, "5 numbers, want 6"),
        (
            {"command": "setProfileAcceleration", "priority": 10, "type": "task", "data": [0] * 6},
            "is 0, want at least",
        ),
        (
            {"command": "setProfileVelocity", "priority": 10, "type": "joints", "data": [1e-320] * 6},
            "0.1% of",
        ),
        ({"command": "setProfileAcceleration", "priority": 10, "type": "joints", "data": ["inf"] * 6}, "is inf"),
        ({**TASK_PATH, "data": [{**POSE, "Position": [0, -1e12, 0]}]}, "data[0] is 1e+12 m from the base"),
        ({"command": "setParameters", "priority": 10, "data": {"Controller": {"Gain": 1}}}, "Controller.Gain"),
        (
            {
                "command": "setParameters",
                "priority": 10,
                "data": {"Controller": {"DesiredJointPosition": {"AttractionPosition": [0] * 5}}},
            },
            "AttractionPosition has 5 numbers, the arm 6 joints",
        ),
    ],
)
def test_what_cannot_be_done_is_an_expected_400_and_takes_no_lock(request_: dict[str, Any], text: str) -> None:
    bench = Bench()
    answer = bench.ask("a", **request_)
    assert (answer["replyCommand"], answer["message"]) == (request_["command"], BAD)
    assert text in answer["text"]
    assert bench.queue == [] and bench.dispatcher.access.priority_under_control == 0


def test_who_has_no_control_receives_403_before_anything_else() -> None:
    bench = Bench(not_offered=frozenset({"setTorque"}))
    bench.ask("a", command="lockControl", priority=5)
    for request in ({**PATH, "data": []}, {**VELOCITY, "command": "setTorque"}, PATH):
        assert bench.ask("b", **request)["message"] == {"code": 403, "detail": 0}
    assert bench.ask("b", **{**PATH, "priority": 5})["message"] == {"code": 403, "detail": 1}


def test_every_command_of_the_seed_is_taken() -> None:
    bench = Bench()
    requests: list[dict[str, Any]] = [
        PATH, TASK_PATH, VELOCITY, TASK_VELOCITY, {**VELOCITY, "command": "setTorque"},
        {**TASK_VELOCITY, "command": "setTorque"}, {**VELOCITY, "command": "setProfileVelocity"},
        {**TASK_VELOCITY, "command": "setProfileAcceleration"}, {"command": "softStop", "priority": 10},
        {"command": "hardStop", "priority": 10}, {"command": "hardStop"},
        {"command": "setParameters", "priority": 10, "data": {"Controller": {}}},
        {"command": "startJointsControl", "priority": 10}, {"command": "startTaskControlLoop", "priority": 10},
        {"command": "resumeControl", "priority": 10},
    ]  # fmt: skip
    for request in requests:
        answer = bench.ask("a", **request)
        assert (answer["replyCommand"], answer["message"]) == (request["command"], OK)
    assert bench.ask("a", command="getConfiguration")["message"]["JointSpaceDegreeOfFreedom"] == 6
    for command in ({"command": "startHeartbeat", "period": 1}, {"command": "heartbeat"}, {"command": "stopHeartbeat"}):
        assert bench.ask("a", **command)["message"] is True


def test_poses_keep_the_representation_they_came_in() -> None:
    bench = Bench()
    seed = {"data": [0, 0, 0.5, 0.1, 0, 0], "representation": 1}
    assert bench.ask("a", **{**TASK_PATH, "data": [POSE, seed], "method": 1, "reference": 2})["message"] == OK
    kinds = [pose.orientation.representation for pose in bench.queue]
    assert kinds == [Representation.QUATERNION, Representation.CARDAN_XYZ]


def test_the_nested_message_is_an_alias_and_the_top_level_wins() -> None:
    bench = Bench()
    nested = {"command": "appendPath", "priority": 10, "message": without(without(PATH, "command"), "priority")}
    assert bench.ask("a", **nested)["message"] == OK
    assert bench.ask("a", message=PATH)["message"] == OK
    assert bench.ask("a", command="foo", message=PATH)["message"] == "Unknown command: foo"
    assert bench.ask("a", command="getStatus", message="hello")["replyCommand"] == "getStatus"


@pytest.mark.parametrize("id_", [0, None, "", [1, {"a": None}], 2**80, 1.5, False])
def test_any_id_comes_back_as_it_was(id_: Any) -> None:
    bench = Bench()
    for request in ({"command": "getStatus"}, {"command": "foo"}, PATH, {"command": "lockControl"}):
        answer = bench.ask("a", **request, id=id_)
        assert "id" in answer and answer["id"] == id_ and type(answer["id"]) is type(id_)
    assert "id" not in bench.ask("a", command="getStatus")


def test_a_named_client_is_reported_its_lease_and_may_fence_with_it() -> None:
    bench = Bench()
    lock = bench.ask("ws1", command="lockControl", priority=10, client="cell", keepAlive=0.5)
    assert (lock["message"], lock["leaseId"], lock["epoch"], lock["keepAlive"]) == (True, 1, "e1", 0.5)
    fenced = {**PATH, "client": "cell", "leaseId": lock["leaseId"], "epoch": lock["epoch"]}
    assert bench.ask("ws2", **fenced)["message"] == OK
    bench.ask("ws1", command="lockControl", priority=5)
    assert bench.ask("ws2", **fenced)["message"] == {"code": 412, "detail": 4}
    assert "leaseId" not in bench.ask("ws1", **{**PATH, "priority": 5}), "who gives no name gets CRF's reply"


def test_a_retry_takes_effect_once_and_gets_the_same_answer() -> None:
    bench = Bench()
    first = bench.ask("a", **PATH, id=3)
    assert bench.ask("a", **PATH, id=3) == first
    assert len(bench.queue) == 1
    bench.ask("b", command="getStatus", id=3)
    assert bench.ask("a", **PATH, id=3) == first and len(bench.queue) == 1
    bench.ask("a", **PATH, id=4)
    bench.ask("a", **PATH)
    assert len(bench.queue) == 3


def test_clients_that_use_one_id_for_everything_are_served() -> None:
    bench = Bench()
    for _ in range(3):
        for command in ("lockControl", "unlockControl"):
            assert bench.ask("a", command=command, priority=10, id=1)["message"] is True
        assert bench.dispatcher.access.priority_under_control == 0
    for q in (0.1, 0.2, 0.1):
        bench.ask("a", **{**PATH, "data": [[q] * 6]}, id=1)
    assert len(bench.queue) == 3, "one id, but not the same request"
    for _ in range(2):
        bench.ask("a", **VELOCITY, id=1)
        assert bench.turn.granted, "the same velocity again refreshes the deadman"


def test_what_was_refused_may_be_tried_again() -> None:
    bench = Bench()
    bench.ask("b", command="lockControl", priority=5)
    assert bench.ask("a", **PATH, id=3)["message"]["code"] == 403
    bench.ask("b", command="unlockControl", priority=5)
    assert bench.ask("a", **PATH, id=3)["message"] == OK
    turn = bench.dispatcher.request("a", json.dumps({**PATH, "id": 9}), bench.now)
    assert turn.granted
    bench.dispatcher.finish(turn.granted, Expected[bool].failed(400), bench.now, "unreachable")
    assert bench.ask("a", **PATH, id=9)["message"] == OK


def test_a_retry_while_the_first_is_being_carried_out_shares_its_answer() -> None:
    bench = Bench()
    text = json.dumps({**PATH, "id": 3})
    first = bench.dispatcher.request("a", text, 0)
    second = bench.dispatcher.request("a", text, 0)
    assert first.granted and first.granted.key == second.shared
    assert second.granted is None and second.reply is None


def test_a_change_of_holder_orders_the_stop_before_the_command() -> None:
    bench = Bench()
    bench.ask("a", **PATH)
    turn = bench.dispatcher.request("b", json.dumps({**PATH, "priority": 5}), 0)
    assert [type(effect) for effect in turn.motion] == [StopMotion]
    assert turn.granted and turn.granted.decision.after_rest
    told = [(e.name, e.to, bench.dispatcher.recipient(e.to)) for e in turn.events]
    assert told == [("controlLost", alias("a"), "a"), ("controlGranted", alias("b"), "b")]
    sent = json.loads(event(turn.events[0].name, turn.events[0].info))
    assert sent["replyCommand"] == "controlLost" and "id" not in sent
    assert sent["message"]["by"] == alias("b") and sent["message"]["reason"] == "preempted"
    MotionEvent(stamp=0, name=turn.events[0].name, to="a", info=turn.events[0].info)


def test_a_closed_connection_stops_its_clients_unless_they_came_back() -> None:
    bench = Bench()
    bench.ask("ws1", **PATH, client="cell")
    bench.ask("ws2", command="getStatus", client="cell")
    bench.take(bench.dispatcher.disconnected("ws1", 0))
    assert bench.queue
    bench.take(bench.dispatcher.disconnected("ws2", 0))
    assert not bench.queue and bench.dispatcher.access.priority_under_control == 0


SESSION = "dGhlIHNlc3Npb24gb2YgYQ"


def test_nobody_is_reported_anothers_session() -> None:
    """Whoever knows a session could act for it, so of a client without a name others see its alias only."""
    bench = Bench()
    told: list[Any] = []

    def ask(session: str, **request: Any) -> dict[str, Any]:
        answer = bench.ask(session, **request)
        told.extend([answer, bench.turn.audit, [(e.name, e.info) for e in bench.turn.events]])
        return answer

    ask(SESSION, **PATH)
    holder = ask("b", command="getStatus")["message"]["holder"]["client"]
    for request in ({**PATH, "priority": 20}, {"command": "lockControl", "priority": 10}, {"command": "softStop"}):
        ask("b", **request)
    assert ask("c", command="getStatus")["message"]["stoppedBy"] == alias("b")
    ask("b", command="lockControl", priority=5)
    assert holder == alias(SESSION)
    assert SESSION not in repr(told)


@pytest.mark.parametrize("name", [alias(SESSION), "#", "", "x" * 129, 7, SESSION])
def test_no_name_makes_a_client_of_anothers_session(name: Any) -> None:
    bench = Bench()
    bench.ask(SESSION, command="lockControl", priority=10, keepAlive=5)
    for request in (PATH, {"command": "unlockControl", "priority": 10}, {"command": "heartbeat"}):
        answer = bench.ask("b", **request, client=name)
        message = answer["message"]
        assert (
            message in (400, "Wrong parameters", "Heartbeat has not been configured", False) or message["code"] == 403
        )
    bench.ask("b", command="getStatus", client=name)
    bench.take(bench.dispatcher.disconnected("b", 0))
    held = bench.dispatcher.access.holder(0)
    assert held and held.client == alias(SESSION) and bench.queue == []


@given(st.lists(st.text(max_size=12) | st.binary(max_size=12).map(lambda b: b.decode("utf-8", "surrogateescape"))))
def test_aliases_are_their_sessions_own_and_no_client_can_be_called_so(sessions: list[str]) -> None:
    assert len({alias(session) for session in sessions}) == len(set(sessions))
    for session in sessions:
        with pytest.raises(ValueError):
            crf.GetStatus(command="getStatus", client=alias(session))


def test_a_session_forgotten_for_newer_ones_still_ends_what_it_held() -> None:
    bench = Bench()
    bench.ask("a", **PATH)
    for i in range(1100):
        bench.ask("flood", command="getStatus", client=f"c{i}")
    bench.take(bench.dispatcher.disconnected("a", 0))
    assert not bench.queue and bench.dispatcher.access.priority_under_control == 0


def test_a_stop_without_priority_is_for_everyone_but_strict_crf() -> None:
    assert Bench().ask("a", command="softStop")["message"] == OK
    assert Bench(strict_crf=True).ask("a", command="softStop")["message"] == 400


def test_streams_send_at_their_rate_or_on_change() -> None:
    bench = Bench()
    assert bench.ask("a", command="startStreamStatus", frequency=30)["message"] is True
    bench.ask("b", command="startStreamStatus", frequency=100, mode=2)
    sent = {"a": 0, "b": 0}
    for ms in range(100):
        status = IDLE.model_copy(update={"stamp": ms, "priority_under_control": int(ms >= 50)})
        for session, message in bench.dispatcher.due(status, ms * 1_000_000):
            assert json.loads(message)["replyCommand"] == "streamStatus"
            sent[session] += 1
    assert sent == {"a": 4, "b": 2}, "every 33 ms; the first, and the change"
    assert bench.ask("a", command="startStreamStatus", frequency=2, mode=2)["message"] is True
    assert bench.ask("a", command="stopStreamStatus")["message"] is True
    assert bench.ask("a", command="stopStreamStatus")["message"] == "Stream was not active"
    bench.dispatcher.disconnected("b", 0)
    assert bench.dispatcher.due(IDLE, SECOND) == []


def test_a_changed_frequency_acts_at_once() -> None:
    stream = StatusStream(0.05, 1, 0)
    assert stream.due(IDLE, 0), "the first is always sent"
    start = SECOND // 2
    stream.change(20, 1, start)
    sent = [t for t in range(start, start + 3 * SECOND, 2_000_000) if stream.due(IDLE, t)]
    assert 59 <= len(sent) <= 61 and sent[0] <= start + 50_000_000
    stream.change(0.05, 1, sent[-1])
    soon = [t for t in range(sent[-1] + 1, sent[-1] + 5 * SECOND, 2_000_000) if stream.due(IDLE, t)]
    assert len(soon) == 1, "what was due already is sent, and then nothing for 20 s"


def test_a_stream_of_too_many_hertz_is_capped_and_missed_periods_are_not_made_up() -> None:
    stream = StatusStream(1e9, 1, 0)
    assert stream.period_ns == 2_000_000
    assert stream.due(IDLE, 7_000_000) and not stream.due(IDLE, 7_000_000)
    assert stream.due(IDLE, 8_000_000)


def test_parameters_come_out_typed() -> None:
    data = {"Controller": {"ObjectiveFunctions": {"JointLimits": {"enable": True, "c": 2.0, "blend": 1.0}}}}
    bench = Bench()
    assert bench.ask("a", command="setParameters", priority=10, data=data)["message"] == OK
    assert [entry.action for entry in bench.turn.audit] == ["grant", "setParameters"]
    granted = bench.turn.granted
    assert granted and isinstance(granted.request, crf.SetParameters)
    functions = parameters_of(granted.request).controller.objective_functions
    assert functions and functions.joint_limits and functions.joint_limits.c == 2.0


@pytest.mark.parametrize("kind", ["joints", "task"])
def test_a_path_of_10_000_points_is_refused_as_a_whole(kind: str) -> None:
    bench = Bench()
    request = {**PATH, "data": [[0.0] * 6] * 10_000} if kind == "joints" else {**TASK_PATH, "data": [POSE] * 10_000}
    answer = bench.ask("a", **request)
    assert answer["message"] == {"code": 413, "detail": 0}
    assert answer["text"] == "10000 points, at most 2000 at a time"
    assert bench.queue == []
    assert bench.ask("a", **{**PATH, "data": [[0.0] * 6] * 2000})["message"] == OK


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
WORDS = sorted({word for model in crf.REQUESTS for word in crf.words(model)})
NAMES = (
    "id", "user", "client", "priority", "type", "data", "method", "reference", "message", "frequency", "mode",
    "period", "keepAlive", "onLoss", "takeover", "force", "leaseId", "epoch", "sequence", "stamp", "timeout",
)  # fmt: skip
LIKELY = st.sampled_from([1, 2, 10, "joints", "task", [0.0] * 6, [[0.0] * 6], [POSE], "NaN", {}])
FIELDS = st.fixed_dictionaries({"command": st.sampled_from(WORDS)}, optional=dict.fromkeys(NAMES, JSON | LIKELY))


@given(st.lists(FIELDS.map(json.dumps) | st.text(max_size=30) | st.binary(max_size=30), max_size=8))
@settings(deadline=None)
def test_whatever_comes_gets_one_answer_of_the_protocol(texts: list[str | bytes]) -> None:
    bench = Bench()
    for text in texts:
        answer = bench.send("a", text)
        assert set(answer) <= {"command", "replyCommand", "message", "id", "text", "leaseId", "epoch", "keepAlive"}
        assert answer["replyCommand"] in {"error", *WORDS}
    assert bench.ask("z", command="getStatus")["replyCommand"] == "getStatus"
