"""Facts in, frames out: the fields of every WebSocket topic."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

from rackhand.schemas import topics
from rackhand.schemas import websocket as ws
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Alert, Contacts, Costmap
from rackhand.schemas.maps import CurrentMap
from rackhand.services.gateway.ws import payloads
from rackhand.services.gateway.ws.facts import Facts
from rackhand.services.gateway.ws.payloads import PAYLOADS
from tests.gateway import messages
from tests.gateway.messages import SECOND


def localised(**changes: Any) -> Facts:
    newest = {"pose": messages.pose(), "odometry": messages.odometry()} | changes
    return Facts({topics.POSE: newest["pose"], topics.MAP: messages.current_map(), topics.ODOMETRY: newest["odometry"]})


def fields(frame: ws.Frame | None) -> dict[str, Any]:
    """What a client gets, but for the topic's name."""
    assert frame is not None
    return frame.model_dump(mode="json", exclude_unset=True)


def test_no_value_before_the_first_message() -> None:
    silent = {name for name, make in PAYLOADS.items() if make(Facts()) is None}
    assert set(PAYLOADS) - silent == {"/slam/state"}
    assert payloads.slam_state(Facts()).state == "inactive"


def test_every_frame_is_registered_under_the_topic_of_its_model() -> None:
    facts = localised()
    for topic, message in (
        (topics.PLANNING_STATE, messages.planning()),
        (topics.PATH, messages.path()),
        (topics.BATTERY, messages.battery()),
        (topics.CONTACTS, Contacts(stamp=SECOND, bumper_front=True)),
        (topics.CHASSIS_STATUS, messages.status()),
        (topics.JACK, messages.jack()),
        (topics.FOOTPRINT, messages.footprint()),
        (topics.LOAD, messages.load()),
        (topics.DETECTED_RACK, messages.detected_rack()),
        (topics.DETECTED_RACK_STATES, messages.rack_states()),
        (topics.MAP_RACK_STATES, messages.rack_states()),
        (topics.SEEN_RACKS, messages.seen_racks()),
        (topics.COSTMAP, costmap(np.zeros(6, np.uint8))),
        (topics.SCAN, messages.scan()),
    ):
        facts.add(topic, message)
    facts.lifts["lift_1"] = messages.lift()
    facts.mappings.begin(Pose2(x=0.0, y=0.0, yaw=0.0), 0)
    made = {name: make(facts) for name, make in PAYLOADS.items()}
    assert {name: frame.TOPIC for name, frame in made.items() if frame is not None} == {name: name for name in made}


def test_planning_state_as_the_documentation_shows_it() -> None:
    assert fields(payloads.planning_state(Facts({topics.PLANNING_STATE: messages.planning()}))) == {
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
    message = messages.planning(move_state="failed", fail_reason=9, target=None)
    failed = fields(payloads.planning_state(Facts({topics.PLANNING_STATE: message})))
    assert failed["fail_reason_str"] == "MoveFailReason::calculation_failed"
    assert failed["target_poses"] == []
    assert "message" not in failed
    message = messages.planning(message="paused: control mode is manual", move_intent="docking")
    held = fields(payloads.planning_state(Facts({topics.PLANNING_STATE: message})))
    assert (held["message"], held["move_intent"]) == ("paused: control mode is manual", "docking")
    message = messages.planning(stuck_state="move_stucked", viewport_blocked=True)
    blocked = fields(payloads.planning_state(Facts({topics.PLANNING_STATE: message})))
    assert (blocked["stuck_state"], blocked["viewport_blocked"]) == ("move_stucked", True)


def test_tracked_pose() -> None:
    assert fields(payloads.tracked_pose(localised())) == {
        "pos": [1.0, 2.0],
        "ori": 0.5,
        "cov": [[0.01, 0.0], [0.0, 0.01]],
    }


def test_slam_state_says_whether_to_rely_on_the_pose() -> None:
    good = fields(payloads.slam_state(localised()))
    assert (good["state"], good["reliable"], good["position_quality"]) == ("positioning", True, 10)
    assert "position_loss_progress" not in good
    poor = fields(payloads.slam_state(localised(pose=messages.pose(quality=3))))
    assert (poor["reliable"], poor["lidar_reliable"], poor["position_loss_progress"]) == (False, False, 0.5)
    stale = fields(payloads.slam_state(localised(odometry=messages.odometry(stamp=SECOND + 1))))
    assert (stale["reliable"], stale["position_quality"], stale["position_loss_progress"]) == (False, 1, 1.0)


def test_map_has_the_png_as_it_is_and_its_size_from_the_header() -> None:
    frame = fields(payloads.occupancy_map(localised()))
    assert base64.b64decode(frame.pop("data")) == messages.grey_png(4, 3)
    assert frame == {"resolution": 0.05, "size": [4, 3], "origin": [-1.0, -2.0]}


def test_map_as_a_file_has_the_same_png_under_a_name_made_of_its_content() -> None:
    facts = localised()
    frame = fields(payloads.map_file(facts))
    folder, _, name = frame.pop("data_url").partition("/")
    assert (folder, name[:4], name[-4:], len(name)) == ("static-files", "map-", ".png", 4 + 64 + 4)
    assert facts.files.get(name) == messages.grey_png(4, 3)
    assert frame == {"stamp": 0.0, "resolution": 0.05, "size": [4, 3], "origin": [-1.0, -2.0]}
    other = CurrentMap(stamp=1, map=messages.current_map(png=messages.grey_png(4, 3, 7)).map)
    facts.add(topics.MAP, other)
    assert fields(payloads.map_file(facts))["data_url"] != f"{folder}/{name}"


def costmap(cost: np.ndarray[Any, Any]) -> Costmap:
    return Costmap(stamp=SECOND, origin=(2.0, 3.0), resolution=0.05, columns=3, cost=cost)


def test_costmap_as_a_file_has_occupied_cells_over_200_and_its_first_row_on_top() -> None:
    facts = Facts({topics.COSTMAP: costmap(np.array([0, 252, 253, 254, 255, 126], np.uint8))})
    frame = fields(payloads.costmap_file(facts))
    png = facts.files.get(frame["data_url"].partition("/")[2])
    assert png is not None
    with Image.open(io.BytesIO(png)) as image:
        assert (image.mode, image.size) == ("L", (3, 2))
        assert np.asarray(image).tolist() == [[254, 0, 99], [0, 198, 254]]
    assert (frame["size"], frame["origin"], frame["stamp"]) == ([3, 2], [2.0, 3.0], 1.0)


def test_map_info() -> None:
    assert fields(payloads.map_info(localised())) == {
        "name": "Hall",
        "uid": "hall",
        "map_version": 1,
        "overlays_version": 2,
        "overlays": {"type": "FeatureCollection", "features": []},
    }


def test_without_a_current_map_there_is_no_map_frame() -> None:
    none = Facts({topics.MAP: CurrentMap(stamp=0)})
    assert (payloads.occupancy_map(none), payloads.map_file(none), payloads.map_info(none)) == (None, None, None)
    assert payloads.slam_state(none).state == "inactive"


@pytest.mark.parametrize(
    ("changes", "shown"),
    [
        ({}, "discharging"),
        ({"charging": True, "current": -3.0}, "charging"),
        ({"charging": True, "percentage": 1.0}, "full"),
        ({"percentage": 1.0}, "discharging"),
    ],
)
def test_battery_state(changes: dict[str, Any], shown: str) -> None:
    facts = Facts(
        {topics.BATTERY: messages.battery(stamp=SECOND, **changes), topics.CLOCK: messages.clock(1_700_000_000)}
    )
    frame = fields(payloads.battery_state(facts))
    assert (frame["power_supply_status"], frame["secs"]) == (shown, 1_700_000_001.0)


def test_modes_stops_and_alerts() -> None:
    alert = Alert(code=8501, level="warning", msg="low")
    status = messages.status(control_mode="remote", emergency_stop=True, alerts=(alert,))
    facts = Facts({topics.CHASSIS_STATUS: status})
    wheels = {"control_mode": "remote", "emergency_stop_pressed": True}
    assert fields(payloads.wheel_state(facts)) == wheels
    assert fields(payloads.chassis_state(facts)) == {**wheels, "parts": wheels}
    assert fields(payloads.alerts(facts)) == {"alerts": [{"code": 8501, "level": "warning", "msg": "low"}]}


def test_jack_state() -> None:
    assert fields(payloads.jack_state(Facts({topics.JACK: messages.jack("jacking_up", 0.5)}))) == {
        "state": "jacking_up",
        "progress": 0.5,
        "self_checking": False,
        "self_check_state": "no_error",
        "weight": 0.0,
    }
    checking = messages.status(jack_checking=True, jack_check="up")
    facts = Facts({topics.JACK: messages.jack("jacking_up", 0.5), topics.CHASSIS_STATUS: checking})
    frame = fields(payloads.jack_state(facts))
    assert (frame["self_checking"], frame["self_check_state"]) == (True, "up")


def test_footprints_have_x_to_the_right_and_y_to_the_front() -> None:
    facts = Facts({topics.FOOTPRINT: messages.footprint()})
    frame = fields(payloads.robot_model(facts))
    assert frame["footprint"] == [[0.2, -0.2], [0.2, 0.4], [-0.2, 0.4], [-0.2, -0.2]]
    assert frame["expanded_footprint"] == [[0.21, -0.21], [0.21, 0.41], [-0.21, 0.41], [-0.21, -0.21]]
    assert frame["width"] == 0.4
    assert fields(payloads.robot_footprint(facts)) == {"footprint": frame["footprint"]}


def test_path_has_headings_and_unix_seconds() -> None:
    facts = Facts({topics.PATH: messages.path(stamp=SECOND), topics.CLOCK: messages.clock(100)})
    assert fields(payloads.path(facts)) == {"stamp": 101.0, "positions": [[0.0, 0.0, 0.0], [1.0, 0.5, 0.25]]}


def test_scan_points_are_in_the_map_frame() -> None:
    quarter_turn = messages.pose(x=1.0, y=2.0, yaw=1.5707963267948966)
    frame = fields(payloads.matched_points(Facts({topics.POSE: quarter_turn, topics.SCAN: messages.scan()})))
    assert frame["points"] == [[1.0, 4.1, 0.0], [1.0, 1.1, 0.0]]


def test_motion_metrics() -> None:
    speeds = Facts({topics.ODOMETRY: messages.odometry()})
    speeds.add(topics.ODOMETRY, messages.odometry(stamp=SECOND // 10, linear=0.5, angular=-0.1))
    assert fields(payloads.motion_metrics(speeds)) == {
        "linear_velocity": 0.5,
        "linear_acc": 5.0,
        "angular_velocity": -0.1,
    }


def test_a_websocket_topic_without_a_payload_function_is_an_error_at_start(monkeypatch: pytest.MonkeyPatch) -> None:
    payloads.check_complete()
    monkeypatch.delitem(PAYLOADS, "/jack_state")
    with pytest.raises(LookupError, match="no payload function makes /jack_state"):
        payloads.check_complete()
