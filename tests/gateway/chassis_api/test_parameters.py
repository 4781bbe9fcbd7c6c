"""``/robot-params``: documented keys, changes of some or none, and what cannot be changed."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.schemas import topics
from rackhand.schemas.parameters import ParameterChanges, SetParameters
from rackhand.services.planner.parameters import Basis
from rackhand.services.planner.settings import NavigationSettings
from rackhand.worlds.chassis_model import load_profile
from tests.gateway import messages
from tests.gateway.harness import Gateway

VELOCITY = "/wheel_control/max_forward_velocity"
TOLERANCE = "/control/bump_tolerance"
FOOTPRINT = "/robot/footprint"
LONGJACK = {
    "/wheel_control/max_forward_velocity": 1.2,
    "/wheel_control/max_backward_velocity": -0.2,
    "/wheel_control/max_forward_acc": 0.5,
    "/wheel_control/max_forward_decel": -2.0,
    "/wheel_control/max_angular_velocity": 1.2,
    "/wheel_control/acc_smoother/smooth_level": "normal",
    "/planning/auto_hold": True,
    "/control/bump_tolerance": 0.5,
    "/control/bump_based_speed_limit/enable": True,
    "/robot/footprint": [[0.2, -0.2], [0.2, 0.4], [-0.2, 0.4], [-0.2, -0.2]],
}


@pytest.fixture
def described(gateway: Gateway) -> Gateway:
    """Its driver has described the chassis."""
    gateway.publish(topics.CHASSIS_MODEL, messages.model())
    return gateway


def get(gateway: Gateway, path: str = "/robot-params") -> dict[str, Any]:
    answer = gateway.http.get(path)
    assert answer.status_code == 200, answer.text
    values: dict[str, Any] = answer.json()
    return values


def test_get_has_the_documented_keys_in_their_order(described: Gateway) -> None:
    values = get(described)
    assert values == LONGJACK
    assert list(values) == list(LONGJACK)
    assert values[FOOTPRINT] == described.http.get("/device/info").json()["robot"]["footprint"]


@pytest.mark.parametrize("path", ["/robot-params", "/robot-params/"])
def test_post_changes_some_and_answers_with_all(described: Gateway, path: str) -> None:
    changes = {VELOCITY: 0.8, TOLERANCE: 0, "/planning/auto_hold": False}
    answer = described.http.post(path, json=changes)
    assert (answer.status_code, answer.json()) == (200, LONGJACK | changes)
    assert get(described, path) == LONGJACK | changes
    assert get(described, path.rstrip("/") + "/default") == LONGJACK
    (asked,) = [request for request in described.bus.requests if isinstance(request, SetParameters)]
    assert asked.changes == ParameterChanges(max_forward_velocity=0.8, bump_tolerance=0.0, auto_hold=False)


def test_what_was_read_may_be_written_back(described: Gateway) -> None:
    assert described.http.post("/robot-params", json=get(described)).json() == LONGJACK
    assert described.http.post("/robot-params", json={}).json() == LONGJACK


@pytest.mark.parametrize(
    ("body", "text"),
    [
        ({VELOCITY: 5}, f"{VELOCITY}: 5 is not in 0 … 1.2 m/s"),
        ({VELOCITY: "fast"}, f"{VELOCITY}: Input should be a valid number, got 'fast'"),
        ({VELOCITY: True}, f"{VELOCITY}: Input should be a valid number, got True"),
        ({"/planning/auto_hold": 1}, "/planning/auto_hold: Input should be a valid boolean, got 1"),
        ({"/wheel_control/wings": 2}, "/wheel_control/wings: Extra inputs are not permitted, got 2"),
        ({"max_forward_velocity": 0.5}, "max_forward_velocity: Extra inputs are not permitted, got 0.5"),
        (
            {"/wheel_control/acc_smoother/smooth_level": "silky"},
            "/wheel_control/acc_smoother/smooth_level: Input should be 'disabled', 'lower', 'normal' or 'higher', "
            "got 'silky'",
        ),
        (
            {FOOTPRINT: [[0.1, -0.1], [0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1]]},
            f"{FOOTPRINT}: is that of the robot's description and cannot be changed here",
        ),
        (
            {FOOTPRINT: [[0.2, -0.2], [0.2, 0.4], [-0.2, 0.4]]},
            f"{FOOTPRINT}: is that of the robot's description and cannot be changed here",
        ),
    ],
)
def test_one_bad_key_is_named_and_nothing_changes(described: Gateway, body: dict[str, Any], text: str) -> None:
    answer = described.http.post("/robot-params", json={TOLERANCE: 0.9} | body)
    assert (answer.status_code, answer.json()) == (400, [text])
    assert get(described) == LONGJACK


def test_those_of_a_jackal_differ(gateway: Gateway) -> None:
    jackal = load_profile("jackal").describe()
    gateway.publish(topics.CHASSIS_MODEL, jackal)
    gateway.bus.basis = Basis(limits=NavigationSettings().for_chassis(jackal).own)
    values = get(gateway)
    assert list(values) == list(LONGJACK)
    assert values[VELOCITY] == jackal.limits.forward != LONGJACK[VELOCITY]
    assert values[FOOTPRINT] != LONGJACK[FOOTPRINT]


def test_a_chassis_that_is_not_described_yet_is_unavailable(gateway: Gateway) -> None:
    for answer in (gateway.http.get("/robot-params"), gateway.http.post("/robot-params", json={VELOCITY: 0.5})):
        assert answer.status_code == 503
        assert answer.json() == {"detail": "the driver of amr1 has not described the chassis yet"}
    assert gateway.bus.requests == []
