"""Thousands of malformed bodies, frames and payloads against a running cell: no crash, no 500, no traceback told.

``RACKHAND_FUZZ_EXAMPLES`` sets how many in all; they are seeded, so that a failure comes back.
"""

from __future__ import annotations

import json
import os
import random
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
import zenoh
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from websockets.sync.client import ClientConnection, connect

from rackhand.bus import Bus, Sample
from rackhand.schemas import topics
from rackhand.schemas.service import CELL, WORLD, ServiceId
from rackhand.schemas.topics import QUERIES, TOPICS
from rackhand.services.planner.jacking import REACHED
from rackhand.testing import Cell, Judge
from tests.system.driving import Driver, standard

pytestmark = pytest.mark.timeout(900)

EXAMPLES = int(os.environ.get("RACKHAND_FUZZ_EXAMPLES", "4000"))
# Of all that is sent: bodies and paths over HTTP, frames over the WebSocket, and the rest as payloads over Zenoh.
BODIES, PATHS, FRAMES = EXAMPLES * 15 // 100, EXAMPLES * 5 // 100, EXAMPLES * 20 // 100
PAYLOADS = EXAMPLES - BODIES - 2 * PATHS - FRAMES

# Whose name a row's key takes, so that every row reaches a service of the cell.
NAMES = {"chassis": "amr1", "arm": "arm1", "world": WORLD, "any": "amr1", "lift": "lift_1"}

POSTS = ("/chassis/moves", "/chassis/current-map", "/chassis/pose", "/maps/", "/services/jack_up",
         "/services/wheel_control/set_control_mode", "/services/wheel_control/set_emergency_stop")  # fmt: skip
PATCHES = ("/chassis/moves/current", "/maps/1", "/chassis/moves/1")
GETS = ("/chassis/moves/{}", "/maps/{}", "/maps/{}.png", "/{}")

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=12),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=12), inner, max_size=4),
    max_leaves=10,
)
FIELDS = ("creator", "type", "target_x", "target_y", "target_ori", "target_accuracy", "use_target_zone", "properties",
          "route_coordinates", "rack_area_id", "map_id", "overlays", "control_mode", "enable", "state",
          "occupancy_grid", "position", "ori")  # fmt: skip
move_like = st.fixed_dictionaries({}, optional=dict.fromkeys(FIELDS, json_values))
bodies = (
    st.binary(max_size=200)
    | (json_values | move_like).map(lambda value: json.dumps(value).encode())
    | st.sampled_from(
        [b"", b"{", b"[" * 5000, b'{"target_x":1e999}', b'{"a":NaN}', b"\xff\xfe", b'{"a":1,"a":2}', b"9" * 400]
    )
)
bounded = settings(
    deadline=None,
    database=None,
    derandomize=True,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)


@pytest.fixture(scope="module")
def cell(real_time_cell: Cell) -> Cell:
    return real_time_cell


@pytest.fixture(scope="module")
def client(cell: Cell) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=cell.http, timeout=30.0) as client:
        yield client


@pytest.fixture(scope="module")
def socket(cell: Cell) -> Iterator[ClientConnection]:
    with topics_of(cell) as socket:
        yield socket


@pytest.fixture(scope="module", autouse=True)
def nobody_dies(cell: Cell) -> Iterator[None]:
    """All processes are the same before and after, and a move still works."""
    services = ("router", "sim", "planner", "controller", "gateway")
    before = [cell.pid(service) for service in services]
    yield
    assert [cell.pid(service) for service in services] == before
    assert "Traceback" not in cell.log.read_text()
    with Judge(cell.bus) as judge:
        driver = Driver(cell, judge)
        driver.request("POST", "/services/wheel_control/set_control_mode", {"control_mode": "auto"})
        driver.request("POST", "/services/wheel_control/set_emergency_stop", {"enable": False})
        driver.use_stored_map()
        lower_jack(cell, driver)
        pose = judge.true_pose("amr1")
        assert driver.drive(standard(pose.x + 1.0 if pose.x < 6 else pose.x - 1.0, 1.5))["state"] == "succeeded"


def topics_of(cell: Cell) -> ClientConnection:
    url = cell.http.replace("http", "ws") + "/ws/v2/topics"
    return connect(url, max_size=None, ping_interval=None)  # on a busy machine the client's pings come late


def lower_jack(cell: Cell, driver: Driver) -> None:
    """A body may have sent it up, and another have stopped it on its way: no move is taken meanwhile."""
    driver.request("POST", "/services/jack_down")
    with topics_of(cell) as socket:
        socket.send(json.dumps({"enable_topic": "/jack_state"}))
        while json.loads(socket.recv(timeout=30)).get("progress", 1.0) > REACHED:
            pass


def check(answer: httpx.Response) -> None:
    assert answer.status_code < 500, (
        f"{answer.request.method} {answer.request.url} -> {answer.status_code} {answer.text}"
    )
    assert "Traceback" not in answer.text


@given(path=st.sampled_from(POSTS), body=bodies)
@settings(bounded, max_examples=max(1, BODIES))
def test_http_posts(client: httpx.Client, path: str, body: bytes) -> None:
    check(client.post(path, content=body, headers={"Content-Type": "application/json"}))


@given(path=st.sampled_from(PATCHES), body=bodies, get=st.sampled_from(GETS), name=st.text(max_size=20))
@settings(bounded, max_examples=max(1, PATHS))
def test_http_patches_and_paths(client: httpx.Client, path: str, body: bytes, get: str, name: str) -> None:
    check(client.patch(path, content=body))
    check(client.get(get.format("".join(f"%{byte:02X}" for byte in name.encode("utf-8", "replace")))))


frames = (
    st.binary(max_size=60)
    | st.text(max_size=60)
    | json_values.map(json.dumps)
    | st.fixed_dictionaries(
        {},
        optional={
            "enable_topic": json_values | st.sampled_from(["/planning_state", "/map", "/twist"]),
            "disable_topic": json_values,
            "topic": json_values | st.sampled_from(["/twist", "/follow_target_state", "/get_device_info_brief"]),
            "linear_velocity": json_values,
            "angular_velocity": json_values,
        },
    ).map(json.dumps)
)


@given(frame=frames)
@settings(bounded, max_examples=max(1, FRAMES))
def test_websocket_frames(socket: ClientConnection, frame: str | bytes) -> None:
    socket.send(frame)


def test_the_socket_still_answers(socket: ClientConnection) -> None:
    socket.send(json.dumps({"enable_topic": "/wheel_state"}))
    while (
        "enabled_topics" not in (told := json.loads(socket.recv(timeout=30)))
        or told["enabled_topics"][0] != "/wheel_state"
    ):
        pass


def test_zenoh_payloads(cell: Cell) -> None:
    """Garbage on every topic and query, from a client that may say anything."""
    rng = random.Random(5)
    served = [query for query in QUERIES if query.server != "viewer"]  # the cell has none
    with zenoh.open(cell.bus_config().zenoh_config()) as session:
        for service in ("amr1/alive/planner", "arm1/alive/controller", "world/alive/sim"):
            session.liveliness().declare_subscriber(f"rackhand/{service}", history=True).recv()
        for _ in range(PAYLOADS):
            row: Any = rng.choice((*TOPICS, *served))
            payload = bytes(rng.randrange(256) for _ in range(rng.randrange(40)))
            if rng.random() < 0.5:
                payload = b"\x81\xa7request\x82\xa2op\xa6create" + payload
            key = row.key_for(NAMES[row.owner])
            if row in served:
                replies = list(session.get(key, payload=payload, timeout=10.0))
                assert len(replies) == 1, f"{key}: {len(replies)} servers"
                assert replies[0].err is not None
                assert b"malformed" in replies[0].err.payload.to_bytes()
            else:
                session.put(key, payload)


def test_the_payloads_reached_planner_controller_and_simulator(cell: Cell) -> None:
    """By their own count: each says once a second of wall time what it could not parse."""
    with Bus(ServiceId("witness", CELL), cell.bus_config()) as bus:
        inbox, counted = bus.inbox().subscribe(topics.BUS_STATS), set()
        while counted < {"planner", "controller", "sim"}:
            event = inbox.get(timeout=20)
            assert isinstance(event, Sample), f"only {counted} counted malformed payloads"
            if event.message.malformed:
                counted.add(event.message.service)
