"""Requests of any kind in any order, as hypothesis draws them, to the gateway of a joined world.

After each one: it was answered, with no status from 500 on, no move failed for an error of the planner, and the robot
has touched nothing.
"""

from __future__ import annotations

import base64
import json
import math
from collections import Counter
from contextlib import ExitStack
from typing import Any, ClassVar

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.parameters import SETTINGS
from tests.gateway.harness import Socket, grey_png
from tests.joined.served import ROBOT, Served

Json = dict[str, Any]
HALL = (20.0, 14.0)  # m
TYPES = (
    "standard", "along_given_route", "align_with_rack", "to_unload_point", "charge", "follow_target", "enter_elevator",
    "return_to_elevator_waiting_point", "leave_elevator",
)  # fmt: skip
PLACES = ((7.8, 9.4), (5.8, 9.4), (7.8, 12.2), (0.72, 1.5), (18.6, 1.2), (7.0, 7.4), (2.5, 1.5), (12.6, 12.2))
AREAS = ("storage", "picking", "no such area", None)
FAULTS = (
    "lidar_dead", "lidar_blind", "wheels_blocked", "power_cable", "emergency_stop_button", "pose_lost",
    "no_charge_contact", "no_charge_current", "battery_critical", "tilted",
)  # fmt: skip
SERVICES = (
    "jack_up", "jack_up", "jack_down", "jack_down", "jack_self_check", "clear_jack_errors", "wake_up_device",
    "start_rack_size_detection", "stop_rack_size_detection", "wheel_control/clear_errors", "monitor/clear_flip_error",
    "clear_slipping_error", "monitor_recheck_errors", "load_cargo", "start_global_positioning",
)  # fmt: skip
READ = (
    "/chassis/moves", "/chassis/moves/current", "/chassis/moves/latest", "/chassis/pose", "/chassis/status",
    "/chassis/jack", "/chassis/current-map", "/maps", "/maps/1", "/maps/1.png", "/maps/2/thumbnail", "/mappings",
    "/ros/map/overlays", "/ros/map/traffic_info", "/system/settings/schema", "/system/settings/effective",
    "/system/settings/user", "/robot-params", "/device/info", "/device/boot_progress", "/services/query_pose/rack_pose",
    "/services/query_pose/charger_pose", "/world/faults", "/hostnames", "/bags", "/healthz",
)  # fmt: skip
TOPICS = (
    "/planning_state", "/path", "/map", "/tracked_pose", "/battery_state", "/alerts", "/jack_state", "/load_state",
    "/scan_matched_points2", "/global_path", "/detected_rack", "/wheel_state", "/no such topic",
)  # fmt: skip
MOST_FRAMES = 20_000  # that may come before an answer: the newest of each topic only are kept for a slow client

across = st.floats(-2.0, HALL[0] + 2.0).map(lambda value: round(value, 2))
along = st.floats(-2.0, HALL[1] + 2.0).map(lambda value: round(value, 2))
points = st.sampled_from(PLACES) | st.tuples(across, along)
angles = st.none() | st.floats(-math.pi, math.pi).map(lambda value: round(value, 3))
numbers = st.sampled_from([row.name for row in SETTINGS if row.type == "float"])


class Operations(RuleBasedStateMachine):
    """``served`` is given by who runs it; ``asked`` counts requests by what they were answered."""

    served: ClassVar[Served]
    asked: ClassVar[Counter[str]] = Counter()

    def __init__(self) -> None:
        super().__init__()
        self._open = ExitStack()
        self._maps = [1]
        self._last = ""

    def teardown(self) -> None:
        self._open.close()

    @initialize(seed=st.integers(1, 1_000_000))
    def begin(self, seed: int) -> None:
        self.served.begin(seed)
        self._socket: Socket = self._open.enter_context(self.served.gateway.websocket())
        self.served.advance(0.4)

    # -- moves -------------------------------------------------------------------------------------------------------

    @rule(kind=st.sampled_from(TYPES), at=points, yaw=angles, area=st.sampled_from(AREAS), zone=st.booleans())
    def create(self, kind: str, at: tuple[float, float], yaw: float | None, area: str | None, zone: bool) -> None:
        body: Json = {"type": kind, "target_x": at[0], "target_y": at[1], "creator": "operations"}
        if yaw is not None:
            body["target_ori"] = yaw
        if zone and kind == "standard":
            body |= {"target_accuracy": 0.5, "use_target_zone": True}
        if kind == "along_given_route":
            body["route_coordinates"] = f"{at[0]}, {at[1]}, {at[1]}, {at[0]}"
        if area is not None and kind in ("align_with_rack", "to_unload_point"):
            body = {"type": kind, "rack_area_id": area, "creator": "operations"}
        self.ask("POST", "/chassis/moves", body)

    @rule(state=st.sampled_from(["cancelled", "paused", "moving", "moving", "sleeping"]))
    def change(self, state: str) -> None:
        self.ask("PATCH", "/chassis/moves/current", {"state": state})

    @rule(number=st.integers(0, 8))
    def explain(self, number: int) -> None:
        self.ask("GET", f"/chassis/moves/{number}/explain")

    @rule()
    def forget_moves(self) -> None:
        self.ask("DELETE", "/chassis/moves")

    # -- the chassis -------------------------------------------------------------------------------------------------

    @rule(name=st.sampled_from(SERVICES))
    def service(self, name: str) -> None:
        self.ask("POST", f"/services/{name}", {})

    @rule(mode=st.sampled_from(["auto", "auto", "remote", "manual"]))
    def control_mode(self, mode: str) -> None:
        self.ask("POST", "/services/wheel_control/set_control_mode", {"control_mode": mode})

    @rule(enable=st.sampled_from([False, False, True]))
    def emergency_stop(self, enable: bool) -> None:
        self.ask("POST", "/services/wheel_control/set_emergency_stop", {"enable": enable})

    @rule(name=numbers, value=st.floats(-1.0, 2.0).map(lambda value: round(value, 2)), reset=st.booleans())
    def setting(self, name: str, value: float, reset: bool) -> None:
        self.ask("PATCH", "/system/settings/user", {name: None if reset else value})

    @rule()
    def no_settings(self) -> None:
        self.ask("POST", "/system/settings/user", {})

    @rule(fault=st.sampled_from(FAULTS), active=st.booleans())
    def fault(self, fault: str, active: bool) -> None:
        self.ask("POST", "/world/faults", {"fault": fault, "target": ROBOT, "active": active})

    # -- maps --------------------------------------------------------------------------------------------------------

    @rule(size=st.sampled_from([100, 300, 500]))
    def create_map(self, size: int) -> None:
        grid = base64.b64encode(grey_png(size, size)).decode()
        answer = self.ask("POST", "/maps", {
            "map_name": "blank", "occupancy_grid": grid, "carto_map": "", "grid_origin_x": -1.0, "grid_origin_y": -1.0,
            "grid_resolution": 0.05,
        })  # fmt: skip
        if isinstance(answer, dict) and "id" in answer:
            self._maps.append(answer["id"])

    @rule(pick=st.integers(0, 3))
    def select_map(self, pick: int) -> None:
        self.ask("POST", "/chassis/current-map", {"map_id": self._maps[pick % len(self._maps)]})

    @rule(pick=st.integers(1, 3))
    def delete_map(self, pick: int) -> None:
        if len(self._maps) > 1:
            self.ask("DELETE", f"/maps/{self._maps.pop(1 + pick % (len(self._maps) - 1))}")

    @rule(at=points, size=st.sampled_from([0.5, 1.5, 4.0]), kind=st.sampled_from(["wall", "zone", "none"]))
    def overlays(self, at: tuple[float, float], size: float, kind: str) -> None:
        known = self.ask("GET", "/ros/map/overlays")
        if not isinstance(known, dict) or "features" not in known:
            return
        (x, y), half = at, size / 2
        ring = [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
        ring = [*ring, ring[0]]
        features = [one for one in known["features"] if one.get("id") != "drawn"]
        if kind == "wall":
            features.append({"type": "Feature", "id": "drawn", "properties": {"lineType": 2},
                             "geometry": {"type": "LineString", "coordinates": ring[:3]}})  # fmt: skip
        elif kind == "zone":
            features.append({"type": "Feature", "id": "drawn", "properties": {"regionType": 1},
                             "geometry": {"type": "Polygon", "coordinates": [ring]}})  # fmt: skip
        self.ask("PUT", "/ros/map/overlays", known | {"features": features})

    # -- reading and listening ---------------------------------------------------------------------------------------

    @rule(path=st.sampled_from(READ))
    def read(self, path: str) -> None:
        self.ask("GET", path)

    @rule(enable=st.lists(st.sampled_from(TOPICS), max_size=3), disable=st.lists(st.sampled_from(TOPICS), max_size=3))
    def subscribe(self, enable: list[str], disable: list[str]) -> None:
        self.send({"enable_topic": enable, "disable_topic": disable}, "enabled_topics")

    @rule(linear=st.floats(-1.0, 1.0), angular=st.floats(-1.0, 1.0))
    def twist(self, linear: float, angular: float) -> None:
        self.send({"topic": "/twist", "linear_velocity": linear, "angular_velocity": angular}, "/twist_feedback")

    @rule(at=points, state=st.sampled_from(["follow_pose", "follow_pose", "pause", "fail"]))
    def followed(self, at: tuple[float, float], state: str) -> None:
        pose = {"pos": list(at)} if state == "follow_pose" else None
        self.send({"topic": "/follow_target_state", "follow_state": state, "target_pose": pose}, "")

    @rule()
    def reconnect(self) -> None:
        self._open.close()
        self._socket = self._open.enter_context(self.served.gateway.websocket("/ws/topics"))

    @rule(seconds=st.sampled_from([0.04, 0.2, 1.0, 2.0]))
    def wait(self, seconds: float) -> None:
        self.served.advance(seconds)

    # -- what must hold ----------------------------------------------------------------------------------------------

    @invariant()
    def nothing_was_touched(self) -> None:
        if self._last:
            contacts = self.served.contacts()
            assert not contacts, f"after {self._last}: {contacts}"

    def ask(self, method: str, path: str, body: Any = None) -> Any:
        """The answer's JSON, or its bytes."""
        self._last = f"{method} {path} {json.dumps(body)[:300]}"
        answer = self.served.gateway.http.request(method, path, json=body)
        self.asked[str(answer.status_code)] += 1
        assert answer.status_code < 500, f"{self._last}: status {answer.status_code}: {answer.text[:500]}"
        assert "Traceback" not in answer.text, f"{self._last}: {answer.text[:2000]}"
        if not answer.content or "json" not in answer.headers.get("content-type", ""):
            return answer.content
        value = answer.json()
        for move in value if isinstance(value, list) else [value]:
            reason = move.get("fail_reason") if isinstance(move, dict) else None
            assert reason != MoveFailReason.INTERNAL_ERROR, f"after {self._last}: {move}"
        return value

    def send(self, frame: Json, wanted: str) -> None:
        """Send a frame and read until it is answered, by what is wanted or by an error; ``""``: it may have none."""
        self._last = f"WebSocket {json.dumps(frame)}"
        self.asked["WebSocket"] += 1
        self._socket.send(frame)
        if not wanted:  # the answer to the next frame shows that this one was taken
            self._socket.send({"enable_topic": [], "disable_topic": []})
            wanted = "enabled_topics"
        for _ in range(MOST_FRAMES):
            answer = self._socket.receive()
            if wanted in answer or answer.get("topic") in (wanted, "/error"):
                if answer.get("topic") == "/error" and wanted == "enabled_topics":
                    continue
                return
        raise AssertionError(f"{self._last}: no answer among {MOST_FRAMES} frames")
