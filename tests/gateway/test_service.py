"""The gateway as a process on a real bus: from a publication to a client, from a request to a planner, and its end."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator

import httpx
import pytest
from typer.testing import CliRunner
from websockets.sync.client import connect

from rackhand.bus import Bus, BusConfig, Presence, Request
from rackhand.schemas import topics
from rackhand.schemas.moves import Move, MoveReply
from rackhand.schemas.service import CELL, ServiceId
from rackhand.services.gateway.__main__ import app
from rackhand.testing.ports import free_port
from tests.gateway import messages
from tests.gateway.fake_bus import NOW
from tests.gateway.harness import PATIENCE, Socket

GATEWAY = ServiceId("gateway", CELL)


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    address = f"tcp/127.0.0.1:{free_port()}"
    router = subprocess.Popen([sys.executable, "-m", "rackhand.bus.router", "--listen", address])
    yield address
    router.terminate()
    assert router.wait(PATIENCE) == 0


def start(endpoint: str, *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "rackhand.services.gateway", *options],
        env=os.environ | {"RACKHAND_BUS_CONNECT": endpoint},
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.system
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_from_the_bus_to_clients_and_back_and_a_clean_end(endpoint: str, number: signal.Signals) -> None:
    port = free_port()
    with Bus(ServiceId("planner", "amr1"), BusConfig(connect=endpoint)) as bus:
        inbox = bus.inbox().watch_services().serve(topics.MOVES, "amr1")
        bus.publisher(topics.CHASSIS_MODEL, "amr1").put(messages.model())
        planning = bus.publisher(topics.PLANNING_STATE, "amr1")
        planning.put(messages.planning(action_id=1))
        bus.announce()
        gateway = start(endpoint, "--port", str(port), "--expect", "amr1/planner")
        while (event := inbox.get(timeout=PATIENCE)) != Presence(GATEWAY, True):
            assert event is not None, "the gateway did not come"
        answering = threading.Thread(target=lambda: answer_moves(inbox))
        answering.start()
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=PATIENCE, trust_env=False) as http:
            answer = http.post("/chassis/moves", json={"target_ori": 1.0})
            assert (answer.status_code, answer.json()["id"], answer.json()["target_ori"]) == (201, 42, 1.0)
            assert http.get("/chassis/current-map").status_code == 503  # nobody serves maps here
        with connect(f"ws://127.0.0.1:{port}/ws/v2/topics", proxy=None) as connection:
            client = Socket(connection)
            client.ask({"enable_topic": ["/planning_state"]})
            if (state := client.receive())["action_id"] != 1:
                raise AssertionError(state)
            for action_id in (2, 3):
                planning.put(messages.planning(action_id=action_id))
            assert [client.receive()["action_id"] for _ in range(2)] == [2, 3]
            gateway.send_signal(number)
            assert gateway.wait(PATIENCE) == 0
        bus.stop()
        answering.join(PATIENCE)
    assert gateway.stderr is not None
    assert "Traceback" not in gateway.stderr.read()
    gateway.stderr.close()


def answer_moves(inbox: object) -> None:
    for event in inbox:  # type: ignore[attr-defined]
        if isinstance(event, Request):
            fields = event.message.request.move.model_dump()
            move = Move(**fields, id=42, state="moving", create_time=NOW, last_modified_time=NOW)
            event.reply(MoveReply(moves=(move,)))


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--expect", "planner"), "want ROBOT/SERVICE"),
        (("--port", "70000"), "port: Input should be less than or equal to 65535"),
    ],
)
def test_a_wrong_option_is_reported_and_nothing_is_started(
    monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], told: str
) -> None:
    monkeypatch.setattr("rackhand.services.gateway.__main__.run", lambda _settings: pytest.fail("it was started"))
    result = CliRunner().invoke(app, options)
    assert result.exit_code == 2
    assert told in " ".join(result.output.replace("│", " ").split())


@pytest.mark.system
def test_a_port_that_is_taken_ends_the_process(endpoint: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        process = start(endpoint, "--port", str(taken.getsockname()[1]))
        _, text = process.communicate(timeout=PATIENCE)
        assert process.returncode != 0
        assert "address already in use" in text
