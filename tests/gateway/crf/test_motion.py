"""The CRF protocol over HTTP and WebSocket: the same texts in, the same answers out."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest
from typer.testing import CliRunner
from websockets.exceptions import InvalidStatus

from rackhand.bus import Unavailable
from rackhand.schemas.motion import ControlInfo, MotionEvent, MotionStream
from rackhand.services.launch.cli import app
from tests.gateway.fake_arm import ArmCell

VECTORS: list[Any] = [
    {"command": "lockControl", "priority": 10, "id": 1},
    {"command": "appendPath", "priority": 10, "type": "joints", "data": [[0, 0, 0, 0, 0, 0]]},
    {"command": "lockControl"},
    {"command": "foo", "id": 7},
    {"command": "softStop"},
    {"message": {"command": "hardStop"}, "id": [1]},
    "nonsense",
    "[1]",
]


@pytest.mark.parametrize("vector", VECTORS, ids=str)
def test_http_and_websocket_carry_the_same(cell: ArmCell, vector: Any) -> None:
    gateway, arm, _ = cell
    text = vector if isinstance(vector, str) else json.dumps(vector)
    by_http = gateway.http.post("/motion/arm1/command", content=text)
    assert by_http.status_code == 200
    with gateway.websocket("/motion/arm1/ws") as client:
        assert client.ask(text) == by_http.json()
    assert by_http.json()["message"] == text
    way = "motion/stop" if "Stop" in text else "motion/command"
    assert [call[0] for call in arm.calls] == [way, way]
    assert len({call[1] for call in arm.calls}) == 2


def test_what_is_no_text_has_the_protocols_answer(cell: ArmCell) -> None:
    gateway, arm, _ = cell
    by_http = gateway.http.post("/motion/arm1/command", content=b"\xff{}").json()
    with gateway.websocket("/motion/arm1/ws") as client:
        assert client.ask(b"\xff{}") == by_http
    assert (by_http["replyCommand"], by_http["message"]) == ("error", "Not valid json format")
    assert arm.calls == []


def test_an_unknown_arm_and_a_missing_chassis_are_404(cell: ArmCell) -> None:
    gateway, _, _ = cell
    for method, path in (("POST", "/motion/arm9/command"), ("GET", "/motion/arm9/status"), ("GET", "/chassis/status")):
        answer = gateway.http.request(method, path)
        assert (answer.status_code, list(answer.json())) == (404, ["detail"])
    with pytest.raises(InvalidStatus) as refused, gateway.websocket("/motion/arm9/ws"):
        pass
    assert refused.value.response.status_code == 404


def test_without_a_controller_it_is_503(cell: ArmCell) -> None:
    gateway, arm, _ = cell
    arm.failure = Unavailable("nobody answers")
    assert gateway.http.post("/motion/arm1/command", json={"command": "getStatus"}).status_code == 503
    with gateway.websocket("/motion/arm1/ws") as client:
        assert client.ask({"command": "getStatus", "id": 3}) == {
            "command": "reply", "replyCommand": "error", "message": 503, "id": 3, "text": "nobody answers"
        }  # fmt: skip


def test_a_stop_overtakes_what_waits_and_what_waits_is_not_sent_after_it(cell: ArmCell) -> None:
    gateway, arm, _ = cell
    arm.held = gateway.call(asyncio.Event)
    with gateway.websocket("/motion/arm1/ws") as client:
        for number in range(20):
            client.send({"command": "appendPath", "id": number})
        client.send({"command": "softStop"})
        answers = [client.receive() for _ in range(5)]
        assert [answer["message"] for answer in answers[:4]] == [409] * 4
        assert [answer["id"] for answer in answers[:4]] == [16, 17, 18, 19]
        assert "softStop" in answers[4]["message"]
        gateway.call(arm.held.set)


def test_events_and_streams_reach_those_they_concern(cell: ArmCell) -> None:
    gateway, arm, context = cell
    gone: list[tuple[str, str]] = []
    context.motion.gone = lambda name, session: gone.append((name, session))
    info = ControlInfo(client="a", priority=1, lease_id=1, epoch="e")
    with gateway.websocket("/motion/arm1/ws") as one, gateway.websocket("/motion/arm1/ws") as two:
        one.ask({"command": "getStatus", "client": "pendant"})
        two.ask({"command": "getStatus"})
        name = arm.calls[0][1]
        for to in ("pendant", ""):
            event = MotionEvent(stamp=0, name="controlLost", to=to, info=info)
            gateway.call(lambda event=event: context.motion.on_event("arm1", event))
        stream = MotionStream(session=name, text='{"replyCommand":"streamStatus"}')
        gateway.call(lambda: context.motion.on_stream("arm1", stream))
        told = [one.receive()["replyCommand"] for _ in range(3)]
        assert told == ["controlLost", "controlLost", "streamStatus"]
        assert two.receive()["replyCommand"] == "controlLost"
        assert "again" in two.ask({"command": "again"})["message"]
    while len(gone) < 2:
        gateway.call(lambda: None)
    assert ("arm1", name) in gone


def test_the_command_line_prints_the_answer(cell: ArmCell) -> None:
    gateway, _, _ = cell
    done = CliRunner().invoke(app, ["motion", "arm1", '{"command":"foo"}', "--url", gateway.url])
    assert (done.exit_code, json.loads(done.output)["message"]) == (0, '{"command":"foo"}')
    lost = CliRunner().invoke(app, ["motion", "arm9", "{}", "--url", gateway.url])
    assert lost.exit_code == 1 and "there is no arm 'arm9' here; known: arm1" in lost.output
