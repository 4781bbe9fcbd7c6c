"""CRF's packet framing over real sockets: the same answers as elsewhere, and what hostile bytes get."""

from __future__ import annotations

import asyncio
import json
import random
import socket
from collections.abc import Iterator
from functools import partial
from typing import Any

import pytest
import uvloop
from pydantic import ValidationError
from typer.testing import CliRunner

from rackhand.schemas.crf_framing import SYNC, Packet, checksum, encode
from rackhand.schemas.motion import ControlInfo, MotionEvent, MotionStream
from rackhand.services.gateway.__main__ import app
from rackhand.services.gateway.crf.tcp import CrfPort, Wire
from rackhand.services.gateway.crf.text import MAX_FRAME, MAX_TEXT
from rackhand.services.gateway.settings import Settings
from rackhand.services.launch.demo.crf import CrfClient
from tests.gateway.crf.test_motion import VECTORS
from tests.gateway.fake_arm import ArmCell

PUBLISHED = bytes.fromhex(
    "7e7e7e7e7e7e" "2103" "17000000" "0000000000000000" "00" "3b"
    "7b22636f6d6d616e64223a22676574537461747573227d"
)  # fmt: skip


@pytest.fixture
def port(cell: ArmCell) -> Iterator[int]:
    gateway, _, context = cell
    crf = CrfPort("arm1", context.motion, partial(context.ask_arm, arm="arm1"))
    yield gateway.run(crf.start("127.0.0.1", 0))
    gateway.run(crf.close())


@pytest.fixture
def client(port: int) -> Iterator[CrfClient]:
    with CrfClient("127.0.0.1", port, writer=7) as client:
        yield client


@pytest.fixture
def gone(cell: ArmCell) -> list[str]:
    """The sessions that are let go."""
    ended: list[str] = []
    cell[2].motion.gone = lambda _, session: ended.append(session)
    return ended


def settle(cell: ArmCell, gone: list[str]) -> None:
    """Until the gateway has noticed that a connection ended."""
    while not gone:
        cell[0].call(lambda: None)


@pytest.mark.parametrize("vector", VECTORS, ids=str)
def test_it_carries_what_http_carries(cell: ArmCell, client: CrfClient, vector: Any) -> None:
    gateway, arm, _ = cell
    text = vector if isinstance(vector, str) else json.dumps(vector)
    assert client.ask(text) == gateway.http.post("/motion/arm1/command", content=text).json()
    assert [call[0] for call in arm.calls] == ["motion/stop" if "Stop" in text else "motion/command"] * 2
    assert len({call[1] for call in arm.calls}) == 2, "a connection is a client of its own"


def test_the_published_packet_and_the_writers_number(cell: ArmCell, client: CrfClient) -> None:
    client.socket.sendall(PUBLISHED)
    assert client.receive()["message"] == '{"command":"getStatus"}'
    assert (client.packet.type, client.packet.writer, client.packet.timestamp) == (801, 0, 0)
    client.ask({"command": "getStatus"})
    assert client.packet.writer == 7
    client.writer = 255
    client.ask({"command": "getStatus"})
    assert client.packet.writer == 255


def test_in_any_pieces(client: CrfClient) -> None:
    data = b"".join(client.frame({"command": "getStatus", "id": i}) for i in range(20))
    cut = random.Random(5)
    while data:
        size = cut.choice([1, 2, 5, 17, 40])
        client.socket.sendall(data[:size])
        data = data[size:]
    ids = [json.loads(client.receive()["message"])["id"] for _ in range(20)]
    assert ids == list(range(20))


@pytest.mark.parametrize(
    "garbage",
    [
        b"\x00\xff" * 1000,
        b"GET / HTTP/1.1\r\nHost: arm\r\n\r\n",
        b"~" * 4001,
        SYNC + b"\x21\x03",
        PUBLISHED[:20],
        PUBLISHED[:15] + bytes([PUBLISHED[15] ^ 1]) + PUBLISHED[16:],
        PUBLISHED[:21] + b"\x3c" + PUBLISHED[22:],
        random.Random(1).randbytes(200_000),
    ],
    ids=["zeros", "http", "tildes", "sync only", "half a header", "wrong timestamp", "wrong checksum", "noise"],
)
def test_garbage_is_skipped_without_an_answer(client: CrfClient, garbage: bytes) -> None:
    """What comes behind half a header may be taken for its rest; the next packet at the latest is heard."""
    client.socket.sendall(garbage)
    client.send({"command": "first"}, {"command": "second"}, {"command": "third"})
    heard = []
    while not heard or "third" not in heard[-1]:
        heard.append(client.receive()["message"])
    assert heard in (['{"command": "first"}', '{"command": "second"}', '{"command": "third"}'],
                     ['{"command": "second"}', '{"command": "third"}'])  # fmt: skip


@pytest.mark.parametrize("type_", [0, 800, 802, 65535])
def test_an_unknown_packet_type_is_reported(cell: ArmCell, client: CrfClient, type_: int) -> None:
    client.socket.sendall(encode(Packet(b'{"command":"getStatus"}', type_, writer=9)))
    assert client.receive() == {
        "command": "reply", "replyCommand": "error", "message": "Not supported packet type",
        "text": f"{type_}, want 801",
    }  # fmt: skip
    assert client.packet.writer == 9
    assert cell[1].calls == []
    assert client.ask({"command": "getStatus"})["message"] == '{"command": "getStatus"}'


@pytest.mark.parametrize("payload", [b"", b"\xff{}", b" " * (MAX_TEXT + 1)], ids=["empty", "no utf-8", "too long"])
def test_what_is_no_request_is_answered_and_the_connection_stays(client: CrfClient, payload: bytes) -> None:
    answer = client.ask(payload)
    if payload:
        assert (answer["replyCommand"], answer["message"]) == ("error", "Not valid json format")
    else:
        assert answer["message"] == ""  # the controller's to judge
    assert client.ask({"command": "getStatus"})["replyCommand"] == "echo"


def test_a_packet_beyond_reason_is_reported_and_ends_the_connection(
    cell: ArmCell, gone: list[str], client: CrfClient
) -> None:
    length = MAX_FRAME + 1
    head = (801).to_bytes(2, "little") + length.to_bytes(4, "little") + bytes(8) + b"\x05"
    client.socket.sendall(SYNC + head + bytes([checksum(801, length, 0, 5)]) + bytes(30_000_000))
    answer = client.receive()
    assert answer["message"] == "Not valid json format"
    assert answer["text"] == f"{length} bytes, at most {MAX_FRAME}"
    with pytest.raises(EOFError):
        client.receive()
    settle(cell, gone)


def test_two_connections_are_two_clients_with_streams_and_events_of_their_own(
    cell: ArmCell, gone: list[str], port: int, client: CrfClient
) -> None:
    gateway, arm, context = cell
    client.ask({"command": "getStatus", "client": "pendant"})
    name = arm.calls[0][1]
    info = ControlInfo(client="a", priority=1, lease_id=1, epoch="e")
    with CrfClient("127.0.0.1", port) as other:
        other.ask({"command": "getStatus"})
        for to in ("pendant", ""):
            event = MotionEvent(stamp=0, name="controlLost", to=to, info=info)
            gateway.call(lambda event=event: context.motion.on_event("arm1", event))
        stream = MotionStream(session=name, text='{"replyCommand":"streamStatus"}')
        gateway.call(lambda: context.motion.on_stream("arm1", stream))
        assert [client.receive()["replyCommand"] for _ in range(3)] == ["controlLost", "controlLost", "streamStatus"]
        assert client.packet.type == 801
        assert other.receive()["replyCommand"] == "controlLost"
        assert "again" in other.ask({"command": "again"})["message"]
    settle(cell, gone)
    assert gone == [arm.calls[1][1]], "who has left is let go, the other is not"


@pytest.mark.parametrize("how", ["close", "half", "reset"])
def test_however_it_ends_the_session_is_let_go(cell: ArmCell, gone: list[str], client: CrfClient, how: str) -> None:
    client.ask({"command": "getStatus"})
    if how == "half":
        client.socket.shutdown(socket.SHUT_WR)
    elif how == "reset":
        client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\x00\x00\x00\x00\x00\x00\x00")
        client.socket.close()
    else:
        client.socket.close()
    settle(cell, gone)
    assert gone == [cell[1].calls[0][1]]


def test_a_flood_is_answered_once_each_and_delays_nobody(cell: ArmCell, port: int, client: CrfClient) -> None:
    gateway, arm, _ = cell
    arm.held = gateway.call(asyncio.Event)
    count = 600
    client.send(*({"command": "appendPath", "id": i} for i in range(count)))
    busy = [client.receive() for _ in range(count - 256 - 16)]
    assert {answer["message"] for answer in busy} == {503}
    with CrfClient("127.0.0.1", port) as other:
        assert "softStop" in other.ask({"command": "softStop"})["message"]
    client.send({"command": "softStop"})
    overtaken = [client.receive() for _ in range(257)]
    assert [answer["message"] for answer in overtaken[:256]] == [409] * 256
    assert "softStop" in overtaken[256]["message"]
    gateway.call(arm.held.set)
    rest = [json.loads(client.receive()["message"])["id"] for _ in range(16)]
    answered = rest + [answer["id"] for answer in busy + overtaken[:256]]
    assert sorted(answered) == list(range(count))


def test_who_does_not_read_is_let_go(cell: ArmCell, gone: list[str], client: CrfClient) -> None:
    request = client.frame({"command": "getStatus", "pad": "x" * 50_000})
    with pytest.raises((ConnectionError, TimeoutError)):
        for _ in range(2000):
            client.socket.sendall(request)
    settle(cell, gone)


def test_an_answer_to_a_connection_that_is_gone_finds_it_gone() -> None:
    async def answer() -> None:
        told: asyncio.Future[None] = asyncio.get_running_loop().create_future()

        async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            wire = Wire(reader, writer)
            writer.transport.abort()
            await asyncio.sleep(0)
            try:
                await wire.send("too late")
            except Exception as error:
                told.set_exception(error)

        server = await asyncio.start_server(accept, "127.0.0.1", 0)
        async with server:
            _, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
            with pytest.raises(ConnectionResetError):
                await asyncio.wait_for(told, 20)
            writer.close()

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:  # as the gateway's own
        runner.run(answer())


def test_only_arms_of_this_gateway_and_never_beside_a_secret() -> None:
    with pytest.raises(ValidationError, match="arm2 is not one of the arms"):
        Settings(arms=("arm1",), crf_ports={"arm2": 5000})
    with pytest.raises(ValidationError, match="carries no secret"):
        Settings(arms=("arm1",), crf_ports={"arm1": 5000}, secret="s")
    assert Settings(arms=("arm1",), crf_ports={"arm1": 0}).crf_ports == {"arm1": 0}


@pytest.mark.parametrize("text", ["5000", "arm1", "arm1=", "=5000", "arm1=x", "arm1=70000"])
def test_a_wrong_option_is_reported(text: str) -> None:
    result = CliRunner().invoke(app, ["--arm", "arm1", "--crf-port", text])
    assert result.exit_code == 2
    assert "ARM=PORT" in result.output or "less than or equal" in result.output
