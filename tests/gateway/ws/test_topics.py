"""Facts in, payloads out: the JSON of every topic."""

from __future__ import annotations

import base64
from dataclasses import replace
from typing import Any

import pytest

from rackhand.schemas.chassis import Alert
from rackhand.schemas.maps import CurrentMap
from rackhand.services.gateway.ws import topics
from rackhand.services.gateway.ws.topics import PAYLOADS, Facts
from tests.gateway import messages
from tests.gateway.messages import SECOND

LOCALISED = Facts(pose=messages.pose(), map=messages.current_map(), odometry=messages.odometry())


def test_nothing_is_made_up_before_it_was_heard() -> None:
    silent = {name for name, make in PAYLOADS.items() if make(Facts()) is None}
    assert set(PAYLOADS) - silent == {"/slam/state"}
    assert topics.slam_state(Facts())["state"] == "inactive"


def test_planning_state_as_the_documentation_shows_it() -> None:
    assert topics.planning_state(Facts(planning=messages.planning())) == {
        "map_uid": "hall",
        "action_id": 7,
        "action_type": "standard",
        "move_state": "moving",
        "fail_reason": 0,
        "fail_reason_str": "none",
        "remaining_distance": 2.875,
        "target_poses": [{"pos": [4.08, 2.99], "ori": 0.0}],
        "charger_pose": {"pos": [0, 0], "ori": 0},
        "going_back_to_charger": False,
        "move_intent": "none",
        "intent_target_pose": {"pos": [0, 0], "ori": 0},
        "stuck_state": "none",
        "given_route_passed_point_count": 0,
    }


def test_planning_state_of_a_failed_and_of_a_blocked_move() -> None:
    failed = topics.planning_state(Facts(planning=messages.planning(move_state="failed", fail_reason=9, target=None)))
    assert failed is not None
    assert failed["fail_reason_str"] == "MoveFailReason::calculation_failed"
    assert failed["target_poses"] == []
    blocked = messages.planning(stuck_state="move_stucked", viewport_blocked=True)
    payload = topics.planning_state(Facts(planning=blocked))
    assert payload is not None
    assert (payload["stuck_state"], payload["viewport_blocked"]) == ("move_stucked", True)


def test_tracked_pose() -> None:
    assert topics.tracked_pose(LOCALISED) == {"pos": [1.0, 2.0], "ori": 0.5, "cov": [[0.01, 0.0], [0.0, 0.01]]}


def test_slam_state_tells_whether_to_rely_on_the_pose() -> None:
    good = topics.slam_state(LOCALISED)
    assert (good["state"], good["reliable"], good["position_quality"]) == ("positioning", True, 10)
    assert "position_loss_progress" not in good
    poor = topics.slam_state(replace(LOCALISED, pose=messages.pose(quality=3)))
    assert (poor["reliable"], poor["lidar_reliable"], poor["position_loss_progress"]) == (False, False, 0.5)
    stale = topics.slam_state(replace(LOCALISED, odometry=messages.odometry(stamp=SECOND + 1)))
    assert (stale["reliable"], stale["position_quality"], stale["position_loss_progress"]) == (False, 1, 1.0)


def test_map_has_the_png_as_it_is_and_its_size_from_the_header() -> None:
    payload = topics.occupancy_map(LOCALISED)
    assert payload is not None
    assert base64.b64decode(payload.pop("data")) == messages.grey_png(4, 3)
    assert payload == {"resolution": 0.05, "size": [4, 3], "origin": [-1.0, -2.0]}


def test_map_info() -> None:
    assert topics.map_info(LOCALISED) == {
        "name": "Hall",
        "uid": "hall",
        "map_version": 1,
        "overlays_version": 2,
        "overlays": {"type": "FeatureCollection", "features": []},
    }


def test_without_a_current_map_there_is_no_map_to_tell() -> None:
    none = Facts(map=CurrentMap(stamp=0))
    assert (topics.occupancy_map(none), topics.map_info(none)) == (None, None)
    assert topics.slam_state(none)["state"] == "inactive"


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({}, "discharging"),
        ({"charging": True, "current": -3.0}, "charging"),
        ({"charging": True, "percentage": 1.0}, "full"),
        ({"percentage": 1.0}, "discharging"),
    ],
)
def test_battery_state(changes: dict[str, Any], told: str) -> None:
    facts = Facts(battery=messages.battery(stamp=SECOND, **changes), clock=messages.clock(1_700_000_000))
    payload = topics.battery_state(facts)
    assert payload is not None
    assert (payload["power_supply_status"], payload["secs"]) == (told, 1_700_000_001.0)


def test_modes_stops_and_alerts() -> None:
    alert = Alert(code=8501, level="warning", msg="low")
    facts = Facts(status=messages.status(control_mode="remote", emergency_stop=True, alerts=(alert,)))
    wheels = {"control_mode": "remote", "emergency_stop_pressed": True}
    assert topics.wheel_state(facts) == wheels
    assert topics.chassis_state(facts) == {**wheels, "parts": wheels}
    assert topics.alerts(facts) == {"alerts": [{"code": 8501, "level": "warning", "msg": "low"}]}


def test_jack_state() -> None:
    assert topics.jack_state(Facts(jack=messages.jack("jacking_up", 0.5))) == {
        "state": "jacking_up",
        "progress": 0.5,
        "self_checking": False,
        "self_check_state": "no_error",
        "weight": 0.0,
    }


def test_footprints_have_x_to_the_right_and_y_to_the_front() -> None:
    payload = topics.robot_model(Facts(model=messages.model()))
    assert payload is not None
    assert payload["footprint"] == [[0.2, -0.2], [0.2, 0.4], [-0.2, 0.4], [-0.2, -0.2]]
    assert payload["width"] == 0.4


def test_path_has_headings_and_unix_seconds() -> None:
    facts = Facts(path=messages.path(stamp=SECOND), clock=messages.clock(100))
    assert topics.path(facts) == {"stamp": 101.0, "positions": [[0.0, 0.0, 0.0], [1.0, 0.5, 0.25]]}


def test_scan_points_are_in_the_map_frame_and_leave_out_what_did_not_return() -> None:
    quarter_turn = messages.pose(x=1.0, y=2.0, yaw=1.5707963267948966).pose
    payload = topics.matched_points(Facts(scan=messages.scan(), scan_pose=quarter_turn))
    assert payload is not None
    assert payload["points"] == [[1.0, 4.1, 0.0], [1.0, 1.1, 0.0]]


def test_motion_metrics() -> None:
    facts = Facts(odometry=messages.odometry(linear=0.5, angular=-0.1), acceleration=0.2)
    assert topics.motion_metrics(facts) == {"linear_velocity": 0.5, "linear_acc": 0.2, "angular_velocity": -0.1}
