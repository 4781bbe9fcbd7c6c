"""The WebSocket: what clients enable, what they are sent at once, and that none of them waits for another."""

from __future__ import annotations

import base64
import json
import os
import socket
import struct
from typing import Any

import pytest

from rackhand.bus import Unavailable
from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Alert, Contacts
from rackhand.services.gateway.ws.broadcast import MAX_EVENTS, MAX_TOPICS
from rackhand.services.gateway.ws.payloads import PAYLOADS
from tests.gateway import messages
from tests.gateway.harness import PATIENCE, Gateway, grey_png

ALERT = Alert(code=8501, level="warning", msg="low")
TWIST = {"topic": "/twist", "linear_velocity": 0, "angular_velocity": -0.6522}


def test_every_change_of_subscription_is_answered_with_the_complete_set_newest_first(gateway: Gateway) -> None:
    with gateway.websocket() as client:
        assert client.ask({"enable_topic": "/alerts"}) == {"enabled_topics": ["/alerts"]}
        assert client.ask({"enable_topic": ["/path", "/no_such_topic"]}) == {
            "enabled_topics": ["/no_such_topic", "/path", "/alerts"]
        }
        assert client.ask({"enable_topic": "/alerts"})["enabled_topics"] == ["/no_such_topic", "/path", "/alerts"]
        assert client.ask({"disable_topic": ["/path", "/never_enabled"]})["enabled_topics"] == [
            "/no_such_topic",
            "/alerts",
        ]
        assert client.ask({"disable_topic": "/alerts", "enable_topic": "/map"})["enabled_topics"] == [
            "/map",
            "/no_such_topic",
        ]


def test_who_connects_is_reported_who_is_there_and_the_others_are_reported_of_it(gateway: Gateway) -> None:
    with gateway.websocket() as first:
        assert json.loads(first.connection.recv(PATIENCE)) == {
            "topic": "/ws_connections",
            "connections": [{"id": 1, "username": "client-1", "email": ""}],
        }
        assert json.loads(first.connection.recv(PATIENCE))["topic"] == "/ws_connection_established"
        with gateway.websocket() as second:
            assert len(json.loads(second.connection.recv(PATIENCE))["connections"]) == 2
            assert json.loads(first.connection.recv(PATIENCE)) == {
                "topic": "/ws_connection_established",
                "id": 2,
                "username": "client-2",
                "email": "",
            }
        assert json.loads(first.connection.recv(PATIENCE))["topic"] == "/ws_connection_disconnected"


STATE_TOPICS = {
    "/tracked_pose": [(topics.POSE, messages.pose())],
    "/slam/state": [(topics.POSE, messages.pose())],
    "/motion_metrics": [(topics.ODOMETRY, messages.odometry())],
    "/planning_state": [(topics.PLANNING_STATE, messages.planning())],
    "/path": [(topics.PATH, messages.path())],
    "/map": [(topics.MAP, messages.current_map())],
    "/map/info": [(topics.MAP, messages.current_map())],
    "/battery_state": [(topics.BATTERY, messages.battery())],
    "/wheel_state": [(topics.CHASSIS_STATUS, messages.status())],
    "/chassis_state": [(topics.CHASSIS_STATUS, messages.status())],
    "/alerts": [(topics.CHASSIS_STATUS, messages.status())],
    "/jack_state": [(topics.JACK, messages.jack())],
    "/robot_model": [(topics.FOOTPRINT, messages.footprint())],
    "/robot/footprint": [(topics.FOOTPRINT, messages.footprint())],
    "/load_state": [(topics.POSE, messages.pose()), (topics.LOAD, messages.load())],
    "/map_rack_states": [(topics.MAP_RACK_STATES, messages.rack_states())],
    "/seen_racks": [(topics.SEEN_RACKS, messages.seen_racks(Pose2(x=1.0, y=2.0, yaw=0.0)))],
    "/lift_states": [(topics.LIFT_STATE, messages.lift())],
    "/map_v2": [(topics.MAP, messages.current_map())],
    "/map/costmap_v2": [(topics.COSTMAP, messages.costmap())],
    "/scan_matched_points2": [(topics.SCAN, messages.scan()), (topics.POSE, messages.pose())],
    "/maps/5cm/1hz": [(topics.COSTMAP, messages.costmap())],
    "/local_path": [(topics.FOOTPRINT, messages.footprint()), (topics.PATH, messages.path())],
    "/detailed_battery_state": [(topics.BATTERY, messages.battery())],
    "/fused_sensor_state": [(topics.ODOMETRY, messages.odometry())],
    "/platform_monitor/travelled_distance": [(topics.ODOMETRY, messages.odometry())],
    "/bumper_state": [(topics.CONTACTS, Contacts(stamp=0))],
}
CHANGED = {
    "/tracked_pose": (topics.POSE, messages.pose(x=7.0), {"pos": [7.0, 2.0]}),
    "/slam/state": (topics.POSE, messages.pose(quality=3), {"reliable": False}),
    "/motion_metrics": (topics.ODOMETRY, messages.odometry(20_000_000, linear=0.5), {"linear_velocity": 0.5}),
    "/planning_state": (topics.PLANNING_STATE, messages.planning(action_id=8), {"action_id": 8}),
    "/path": (topics.PATH, messages.path(stamp=messages.SECOND), {"stamp": 1.0}),
    "/map": (topics.MAP, messages.current_map(png=grey_png(5, 3)), {"size": [5, 3]}),
    "/map_v2": (topics.MAP, messages.current_map(png=grey_png(5, 3)), {"size": [5, 3]}),
    "/map/costmap_v2": (topics.COSTMAP, messages.costmap(columns=2), {"size": [2, 3]}),
    "/map/info": (topics.MAP, messages.current_map(name="Yard"), {"name": "Yard"}),
    "/battery_state": (topics.BATTERY, messages.battery(percentage=0.5), {"percentage": 0.5}),
    "/wheel_state": (topics.CHASSIS_STATUS, messages.status(emergency_stop=True), {"emergency_stop_pressed": True}),
    "/chassis_state": (topics.CHASSIS_STATUS, messages.status(control_mode="manual"), {"control_mode": "manual"}),
    "/alerts": (topics.CHASSIS_STATUS, messages.status(alerts=(ALERT,)), {"alerts": [ALERT.model_dump()]}),
    "/jack_state": (topics.JACK, messages.jack("jacking_up", 0.5), {"state": "jacking_up", "progress": 0.5}),
    "/robot_model": (topics.FOOTPRINT, messages.footprint(half_width=0.3), {"width": 0.6}),
    "/robot/footprint": (
        topics.FOOTPRINT,
        messages.footprint(half_width=0.3),
        {"footprint": [[0.3, -0.2], [0.3, 0.4], [-0.3, 0.4], [-0.3, -0.2]]},
    ),
    "/seen_racks": (topics.SEEN_RACKS, messages.seen_racks(), {"racks": []}),
    "/lift_states": (
        topics.LIFT_STATE,
        messages.lift("floor2", door="closing", opening=0.25, holder=None),
        {
            "lifts": [
                {
                    "name": "amr1",
                    "floor": "floor2",
                    "target": None,
                    "moving": False,
                    "door": "closing",
                    "opening": 0.25,
                    "blocked": False,
                    "holder": None,
                    "waiting": [],
                }
            ]
        },
    ),
    "/load_state": (topics.LOAD, messages.load("under_rack"), {"state": "under_rack"}),
    "/map_rack_states": (
        topics.MAP_RACK_STATES,
        messages.rack_states().model_copy(update={"racks": ()}),
        {"racks": []},
    ),
    "/scan_matched_points2": (topics.SCAN, messages.scan(left=3.0), {"points": [[-0.351, 4.681, 0.0]]}),
    "/maps/5cm/1hz": (topics.COSTMAP, messages.costmap(columns=2), {"size": [2, 3]}),
    "/local_path": (topics.FOOTPRINT, messages.footprint(half_width=0.3), {"width": 0.6}),
    "/detailed_battery_state": (topics.BATTERY, messages.battery(percentage=0.5), {"percentage": 0.5}),
    "/fused_sensor_state": (topics.ODOMETRY, messages.odometry(20_000_000, linear=0.5), {"is_still": False}),
    "/platform_monitor/travelled_distance": (topics.ODOMETRY, messages.odometry(20_000_000), {"duration": 0.02}),
    "/bumper_state": (topics.CONTACTS, Contacts(stamp=1, bumper_front=True), {"front_bumper_pressed": True}),
}


ELSEWHERE = {"/trajectory", "/sensor_manager_state", "/horizontal_laser_2d/matched"}  # test_payloads, test_mapping


def test_every_topic_is_tried() -> None:
    assert set(STATE_TOPICS) == set(CHANGED)
    assert set(STATE_TOPICS) | set(NOT_LATCHED) | ELSEWHERE == set(PAYLOADS)


NOT_LATCHED = {
    "/detected_rack": (topics.DETECTED_RACK, messages.detected_rack(), {"rack_detected": True}),
    "/detected_rack_states": (topics.DETECTED_RACK_STATES, messages.rack_states(), {"map_uid": "hall"}),
}


@pytest.mark.parametrize("topic", NOT_LATCHED)
def test_what_is_seen_at_the_moment_is_not_sent_to_a_client_that_comes_later(gateway: Gateway, topic: str) -> None:
    row, message, fields = NOT_LATCHED[topic]
    gateway.publish(row, message)
    gateway.publish(topics.FOOTPRINT, messages.footprint())
    with gateway.websocket() as client:
        assert client.ask({"enable_topic": topic}) == {"enabled_topics": [topic]}
        client.send({"enable_topic": "/robot_model"})
        assert "enabled_topics" in client.receive()
        assert client.receive()["topic"] == "/robot_model"
        gateway.publish(row, message)
        frame = client.receive()
        assert frame["topic"] == topic and fields.items() <= frame.items()


@pytest.mark.parametrize("topic", STATE_TOPICS)
def test_a_state_topic_is_sent_to_a_client_as_it_enables_it_and_again_when_it_changes(
    gateway: Gateway, topic: str
) -> None:
    for row, message in STATE_TOPICS[topic]:
        gateway.publish(row, message)
    row, message, fields = CHANGED[topic]
    with gateway.websocket() as client:
        assert client.ask({"enable_topic": topic}) == {"enabled_topics": [topic]}
        latched = client.receive()
        assert latched["topic"] == topic
        assert {name: latched[name] for name in fields} != fields
        gateway.publish(row, message)
        changed = client.receive()
        assert changed["topic"] == topic
        assert {name: changed[name] for name in fields} == fields


def test_what_was_disabled_is_silent(gateway: Gateway) -> None:
    with gateway.websocket() as client:
        client.ask({"enable_topic": ["/path", "/battery_state"]})
        client.ask({"disable_topic": "/path"})
        gateway.publish(topics.PATH, messages.path())
        gateway.publish(topics.BATTERY, messages.battery())
        assert client.receive()["topic"] == "/battery_state"


def test_the_legacy_end_point_has_its_own_names(gateway: Gateway) -> None:
    gateway.publish(topics.POSE, messages.pose())
    with gateway.websocket("/ws/topics/") as old, gateway.websocket() as new:
        assert old.ask({"enable_topic": "/chassis/pose"}) == {"enabled_topics": ["/chassis/pose"]}
        new.ask({"enable_topic": "/tracked_pose"})
        assert {**old.receive(), "topic": "/tracked_pose"} == new.receive()
        new.ask({"enable_topic": "/chassis/pose"})
        gateway.publish(topics.POSE, messages.pose(x=5))
        assert old.receive()["topic"] == "/chassis/pose"
        assert new.receive()["topic"] == "/tracked_pose"


@pytest.mark.parametrize(
    "frame",
    [
        "",
        "nonsense",
        "[]",
        "null",
        "{}",
        '{"enable_topic": 1}',
        '{"enable_topic": ["/a", null]}',
        '{"enable_topic": ""}',
        '{"enable_topic": "/a", "enable_topic": "/b"}',
        '{"topic": "/unheard_of"}',
        '{"topic": ["/twist"]}',
        '{"topic": "/twist"}',
        '{"topic": "/twist", "linear_velocity": NaN, "angular_velocity": 0}',
        '{"topic": "/twist", "linear_velocity": "fast", "angular_velocity": 0}',
        "[" * 100_000,
        b"\x00\xff",
        json.dumps({"enable_topic": [f"/{n}" for n in range(MAX_TOPICS + 1)]}),
    ],
)
def test_a_malformed_frame_is_reported_so_and_the_connection_stays(gateway: Gateway, frame: Any) -> None:
    with gateway.websocket() as client:
        error = client.ask(frame)
        assert error["topic"] == "/error"
        assert error["detail"]
        assert client.ask({"enable_topic": "/a"})["enabled_topics"][0] == "/a"


def test_frames_in_binary_are_read_too(gateway: Gateway) -> None:
    with gateway.websocket() as client:
        assert client.ask(b'{"enable_topic": "/a"}') == {"enabled_topics": ["/a"]}


def test_remote_driving_is_fed_back_per_command_and_refused_in_other_modes(gateway: Gateway) -> None:
    with gateway.websocket() as client:
        assert client.ask(TWIST) == {
            "topic": "/error",
            "detail": "precondition: the control mode is auto; remote driving needs mode remote",
        }
        gateway.http.post("/services/wheel_control/set_control_mode", json={"control_mode": "remote"})
        for _ in range(3):
            assert client.ask(TWIST) == {"topic": "/twist_feedback"}
        twist = gateway.bus.requests[-1].twist
        assert (twist.linear, twist.angular) == (0.0, -0.6522)
        gateway.bus.failure = Unavailable("nobody drives")
        assert client.ask(TWIST) == {"topic": "/error", "detail": "nobody drives"}


FOLLOW = {"topic": "/follow_target_state", "follow_state": "follow_pose"}


@pytest.mark.parametrize(
    ("frame", "position", "yaw"),
    [
        ({"follow_state": "follow_pose", "target_pose": {"pos": [1.5, 2], "ori": 0.5}}, (1.5, 2.0), 0.5),
        ({"follow_state": "follow_pose", "target_pose": {"pos": [1.5, 2.0]}}, (1.5, 2.0), None),
        ({"follow_state": "follow_pose", "target_pose": {"ori": 0}}, None, 0.0),
        ({"follow_state": "pause"}, None, None),
        ({"follow_state": "pause", "target_pose": {"pos": [1.5, 2.0]}}, None, None),
        ({"follow_state": "fail"}, None, None),
    ],
)
def test_the_target_to_follow_goes_to_the_planner(
    gateway: Gateway, frame: dict[str, Any], position: tuple[float, float] | None, yaw: float | None
) -> None:
    """A frame that was taken is not answered: the answer that comes is that to the next question."""
    with gateway.websocket() as client:
        client.send({"topic": "/follow_target_state"} | frame)
        assert client.ask({"topic": "/get_device_info_brief"})["topic"] == "/device_info_brief"
        target = gateway.bus.requests[-1]
        assert (target.state, target.position, target.yaw) == (frame["follow_state"], position, yaw)


@pytest.mark.parametrize(
    ("frame", "detail"),
    [
        (FOLLOW, "target_pose: want pos, ori or both with follow_state 'follow_pose'"),
        (FOLLOW | {"target_pose": {}}, "target_pose: want pos, ori or both with follow_state 'follow_pose'"),
        (FOLLOW | {"target_pose": {"pos": [1.0]}}, "target_pose.pos: "),
        (FOLLOW | {"target_pose": {"pos": ["a", 2]}}, "target_pose.pos.0: "),
        (FOLLOW | {"target_pose": [1, 2]}, "target_pose: "),
        ({"topic": "/follow_target_state"}, "follow_state: "),
        ({"topic": "/follow_target_state", "follow_state": "stop"}, "follow_state: "),
    ],
)
def test_a_malformed_target_is_answered_and_changes_nothing(
    gateway: Gateway, frame: dict[str, Any], detail: str
) -> None:
    with gateway.websocket() as client:
        answer = client.ask(frame)
        assert (answer["topic"], answer["detail"][: len(detail)]) == ("/error", detail)
        assert not any(getattr(request, "op", "") == "follow_target" for request in gateway.bus.requests)


def test_a_target_that_the_planner_refuses_is_answered(gateway: Gateway) -> None:
    gateway.bus.failure = Unavailable("no follow_target move is running")
    with gateway.websocket() as client:
        answer = client.ask(FOLLOW | {"target_pose": {"ori": 1.0}})
        assert answer == {"topic": "/error", "detail": "no follow_target move is running"}


def test_device_info_on_request(gateway: Gateway) -> None:
    gateway.publish(topics.CHASSIS_MODEL, messages.model())
    with gateway.websocket() as client:
        reply = client.ask({"topic": "/get_device_info_brief"})
        assert reply["topic"] == "/device_info_brief"
        assert reply["device"]["model"] == "longjack"


def test_a_client_that_does_not_read_delays_no_other_and_holds_a_bounded_backlog(gateway: Gateway) -> None:
    maps = [grey_png(1000, 400, shade) for shade in range(2)]
    with deaf_client(gateway.port, "/map"), gateway.websocket(max_size=None) as client:
        client.ask({"enable_topic": "/map"})
        for turn in range(40):  # 20 MB: far more than the kernel holds for a client that does not read
            gateway.publish(topics.MAP, messages.current_map(png=maps[turn % 2]))
            assert base64.b64decode(client.receive()["data"]) == maps[turn % 2]
        for number in range(3 * MAX_EVENTS):
            gateway.publish(topics.PLANNING_STATE, messages.planning(action_id=number))
        deaf = gateway.call(lambda: next(iter(gateway.hub.clients.values())).outbox)
        assert gateway.call(lambda: deaf.dropped) > 0
        assert gateway.call(lambda: len(deaf._newest)) == 1
        assert gateway.call(lambda: len(deaf._events)) <= MAX_EVENTS


class deaf_client:  # noqa: N801 - used as a function
    """A WebSocket client that enables topics and then never reads."""

    def __init__(self, port: int, topic: str) -> None:
        self.port = port
        self.topic = topic

    def __enter__(self) -> socket.socket:
        self.socket = raw_websocket(self.port)
        self.socket.sendall(client_frame(json.dumps({"enable_topic": [self.topic, "/planning_state"]}).encode()))
        return self.socket

    def __exit__(self, *_: object) -> None:
        self.socket.close()


def raw_websocket(port: int) -> socket.socket:
    """A connection that has gone through the handshake, no further."""
    raw = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
    key = base64.b64encode(os.urandom(16)).decode()
    raw.sendall(
        f"GET /ws/v2/topics HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    head = b""
    while b"\r\n\r\n" not in head:
        head += raw.recv(1)
    assert b"101" in head.split(b"\r\n")[0]
    return raw


def client_frame(payload: bytes, opcode: int = 1) -> bytes:
    mask = b"\1\2\3\4"
    size = bytes([0x80 | len(payload)]) if len(payload) < 126 else b"\xfe" + struct.pack(">H", len(payload))
    masked = bytes(byte ^ mask[index % 4] for index, byte in enumerate(payload))
    return bytes([0x80 | opcode]) + size + mask + masked
