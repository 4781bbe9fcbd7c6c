"""Health, boot progress and device info over HTTP."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.bus import Presence
from rackhand.schemas import topics
from rackhand.schemas.chassis import JackModel
from rackhand.schemas.service import ServiceId
from rackhand.services.gateway.build import git_info
from rackhand.services.gateway.settings import Settings
from tests.gateway import messages
from tests.gateway.harness import Gateway, running_gateway

SETTINGS = Settings(expect=("amr1/planner", "world/sim"))
PLANNER, SIM, VIEWER = ServiceId("planner", "amr1"), ServiceId("sim", "world"), ServiceId("viewer", "cell")


def test_healthz_has_one_row_a_service_and_is_200_only_when_all_expected_are_up() -> None:
    with running_gateway(SETTINGS, SETTINGS.expected_services()) as gateway:
        gateway.presence(Presence(PLANNER, True), Presence(VIEWER, True), Presence(VIEWER, False))
        answer = gateway.http.get("/healthz")
        assert answer.status_code == 503
        rows = {f"{row['robot']}/{row['service']}": row for row in answer.json()["services"]}
        assert {name: row["status"] for name, row in rows.items()} == {
            "amr1/planner": "up",
            "world/sim": "down",
            "cell/gateway": "up",
            "cell/viewer": "down",
        }
        assert rows["world/sim"]["since"] is None
        assert (rows["cell/viewer"]["expected"], rows["world/sim"]["expected"]) == (False, True)
        gateway.presence(Presence(SIM, True))
        answer = gateway.http.get("/healthz")
        assert (answer.status_code, answer.json()["status"]) == (200, "up")
        gateway.presence(Presence(PLANNER, False))
        assert gateway.http.get("/healthz").status_code == 503
        gateway.presence(Presence(PLANNER, True))
        row = gateway.http.get("/healthz").json()["services"][0]
        assert (row["service"], row["restarts"], row["alive"]) == ("planner", 1, True)


def test_boot_progress_is_always_200() -> None:
    with running_gateway(SETTINGS, SETTINGS.expected_services()) as gateway:
        assert gateway.http.get("/device/boot_progress").json() == {"start_time": 1000.0, "progress": 0.0, "logs": []}
        gateway.presence(Presence(SIM, True))
        boot = gateway.http.get("/device/boot_progress").json()
        assert boot["progress"] == 0.5
        assert boot["logs"][0]["msg"] == "world/sim is up"


def test_device_info_tells_the_body_once_it_is_known(gateway: Gateway) -> None:
    assert gateway.http.get("/device/info").status_code == 503
    gateway.publish(topics.CHASSIS_MODEL, messages.model())
    info = gateway.http.get("/device/info").json()
    assert {"axbot_version", "device", "robot", "caps"} <= set(info)
    assert info["device"]["model"] == "longjack"
    robot = info["robot"]
    assert robot["footprint"][0] == [0.2, -0.2]
    assert (robot["inscribed_radius"], robot["width"], robot["thickness"], robot["height"]) == (0.2, 0.4, 0.6, 0.245)
    assert robot["wheel_distance"] == 0.35
    assert info["caps"]["supportsWsV2"] is True


@pytest.mark.parametrize(
    ("side", "told"),
    [
        ("back", {"charge_contact": {"pose_2d": [0.0, -0.2, -1.5708]}, "charge_contact_position": "back"}),
        ("front", {"charge_contact": {"pose_2d": [0.0, 0.4, 1.5708]}, "charge_contact_position": "front"}),
        ("none", {}),
    ],
)
def test_device_info_says_where_the_charge_contacts_are(gateway: Gateway, side: str, told: dict[str, Any]) -> None:
    """The model reaches 0.4 m to the front and 0.2 m to the back; y is to the front in this API."""
    gateway.publish(topics.CHASSIS_MODEL, messages.model().model_copy(update={"charge_contact": side}))
    robot = gateway.http.get("/device/info").json()["robot"]
    assert {key: value for key, value in robot.items() if key.startswith("charge_contact")} == told


@pytest.mark.parametrize("jack", [None, JackModel(stroke=0.1, duration=10.0, max_load=100.0)])
def test_device_info_claims_a_jack_only_where_there_is_one(gateway: Gateway, jack: JackModel | None) -> None:
    gateway.publish(topics.CHASSIS_MODEL, messages.model().model_copy(update={"jack": jack}))
    caps = gateway.http.get("/device/info").json()["caps"]
    assert caps["supportsJack"] is caps["supportsDynamicFootprints"] is (jack is not None)
    assert caps["supportsWsV2"] is True


def test_device_info_says_which_commit_runs(gateway: Gateway, monkeypatch: pytest.MonkeyPatch) -> None:
    git_info.cache_clear()
    monkeypatch.setenv("RACKHAND_COMMIT", "0123abc")
    gateway.publish(topics.CHASSIS_MODEL, messages.model())
    assert gateway.http.get("/device/info").json()["gitinfo"] == {"commit": "0123abc"}
    git_info.cache_clear()


def test_chassis_status(gateway: Gateway) -> None:
    gateway.publish(topics.CHASSIS_STATUS, messages.status(control_mode="manual"))
    assert gateway.http.get("/chassis/status").json() == {
        "control_mode": "manual",
        "emergency_stop_pressed": False,
        "wheel_overloaded": False,
    }
