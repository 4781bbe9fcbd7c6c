"""The jack over HTTP: its services, its state for clients that poll, and the pose of the rack."""

from __future__ import annotations

import math

import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.racks import LoadReport
from tests.gateway import messages
from tests.gateway.harness import Gateway


@pytest.mark.parametrize(
    ("service", "op"),
    [
        ("jack_up", "jack"),
        ("jack_down", "jack"),
        ("jack_self_check", "jack_self_check"),
        ("clear_jack_errors", "clear_jack_errors"),
        ("start_rack_size_detection", "detect_racks"),
        ("stop_rack_size_detection", "detect_racks"),
    ],
)
def test_services_of_the_jack_are_asked_of_the_planner(gateway: Gateway, service: str, op: str) -> None:
    answer = gateway.http.post(f"/services/{service}", json={})
    assert (answer.status_code, answer.json()) == (200, {})
    (asked,) = gateway.bus.requests
    assert asked.op == op and getattr(asked, "direction", service[5:]) == service[5:]
    assert getattr(asked, "enable", service.startswith("start")) == service.startswith("start")


def test_the_jack_for_clients_that_poll(gateway: Gateway) -> None:
    assert gateway.http.get("/chassis/jack").status_code == 503
    gateway.publish(topics.CHASSIS_MODEL, messages.model())
    gateway.publish(topics.JACK, messages.jack("jacking_up", 0.25))
    gateway.publish(topics.LOAD, messages.load("under_rack"))
    gateway.publish(topics.CHASSIS_STATUS, messages.status(jack_checking=True, jack_check="up"))
    answer = gateway.http.get("/chassis/jack")
    assert (answer.status_code, answer.json()) == (
        200,
        {
            "state": "jacking_up",
            "progress": 0.25,
            "self_checking": True,
            "self_check_state": "up",
            "weight": 0.0,
            "load": "under_rack",
        },
    )


def test_a_chassis_without_a_jack_has_none_to_show(gateway: Gateway) -> None:
    gateway.publish(topics.CHASSIS_MODEL, messages.model().model_copy(update={"jack": None}))
    answer = gateway.http.get("/chassis/jack")
    assert (answer.status_code, answer.json()) == (404, {"detail": "amr1 has no jack"})


def test_the_pose_of_the_rack_is_in_the_map(gateway: Gateway) -> None:
    path = "/services/query_pose/rack_pose"
    assert gateway.http.get(path).status_code == 503
    gateway.publish(topics.LOAD, LoadReport(stamp=0))
    answer = gateway.http.get(path)
    assert (answer.status_code, answer.json()) == (
        404,
        {"detail": "the robot neither carries a rack nor is it under one"},
    )
    gateway.publish(topics.LOAD, messages.load("under_rack", Pose2(x=7.0, y=3.0, yaw=0.1)))
    assert gateway.http.get(path).json() == {"pose": {"pos": [7.0, 3.0], "ori": 0.1}}
    gateway.publish(topics.LOAD, messages.load())
    gateway.publish(topics.POSE, messages.pose(x=1.0, y=2.0, yaw=0.0))
    assert gateway.http.get(path).json() == {"pose": {"pos": [1.5, 2.0], "ori": pytest.approx(math.pi / 2, abs=1e-4)}}
