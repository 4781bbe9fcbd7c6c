"""A client of the chassis API: HTTP for orders, the WebSocket for what becomes of them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

from rackhand.services.launch.api_connection import ApiConnection, Json, NoAnswer, NotInTime, is_jack_at
from rackhand.services.launch.demo.errors import StoryError

TOPICS = ("/planning_state", "/jack_state", "/battery_state", "/load_state")
ENDED = ("succeeded", "failed", "cancelled")
PATIENCE = 600.0  # s of wall time; only ever bounds a failure


class ChassisClient(ApiConnection):
    """``waiting`` is called with a text when there is news of what is waited for."""

    def __init__(self, url: str, waiting: Callable[[str], None]) -> None:
        super().__init__(url, TOPICS)
        self._waiting = waiting

    def request(self, method: str, path: str, body: Json | None = None) -> Any:
        """The answer's JSON. Raises ``StoryError`` with the reason of a refusal."""
        try:
            status, content = self.send(method, path, body)
        except NoAnswer as error:
            raise StoryError(str(error)) from None
        if not 200 <= status < 300:
            text = content.decode(errors="replace")
            raise StoryError(f"{method} {path} {body}: status {status}: {text[:300]}")
        return json.loads(content)

    def move(self, move_type: str, **target: float) -> None:
        """Post a move and wait until it has succeeded. Raises ``StoryError`` with its reason otherwise."""
        move = self.request("POST", "/chassis/moves", {"creator": "demo", "type": move_type, **target})["id"]
        self._wait(
            "/planning_state",
            lambda state: state["action_id"] == move and state["move_state"] in ENDED,
            lambda state: _shown(move_type, state["remaining_distance"]),
        )
        record = self.request("GET", f"/chassis/moves/{move}")
        if record["state"] != "succeeded":
            reason = f"{record['fail_reason_str']} ({record['fail_reason']}): {record['fail_message']}"
            raise StoryError(f"move {move}, {move_type} {target}: {record['state']}, {reason}")

    def jack(self, direction: str) -> None:
        """Raise or lower the jack, and wait until it has arrived and the load is known."""
        load = "carrying" if direction == "up" else "under_rack"
        self.request("POST", f"/services/jack_{direction}", {})
        self._wait(
            "/jack_state",
            lambda jack: is_jack_at(jack, direction),
            lambda jack: f"jack {direction}, at {jack['progress']:.0%}",
        )
        self._wait("/load_state", lambda now: now["state"] == load, lambda now: f"load {load}, is {now['state']}")

    def wait_until_charging(self) -> float:
        """Until current flows into the battery; how full it is (0 … 1)."""
        battery = self._wait(
            "/battery_state",
            lambda state: state["power_supply_status"] in ("charging", "full"),
            lambda state: f"current, battery is {state['power_supply_status']}",
        )
        return float(battery["percentage"])

    def points(self) -> dict[str, tuple[float, float, float]]:
        """Rack points and the charger of the map in use: name → x, y (m), heading (rad) of the robot there."""
        current = self.request("GET", "/chassis/current-map")
        overlays = json.loads(self.request("GET", f"/maps/{current['id']}")["overlays"])
        found = {}
        for feature in overlays["features"]:
            properties = feature["properties"]
            if feature["geometry"]["type"] == "Point" and "name" in properties:
                x, y = feature["geometry"]["coordinates"][:2]
                found[properties["name"]] = (x, y, math.radians(float(properties.get("yaw", 0.0))))
        return found

    def rack_pose(self) -> tuple[float, float, float]:
        """Where the robot sees the rack that it is under or carries."""
        pose = self.request("GET", "/services/query_pose/rack_pose")["pose"]
        return pose["pos"][0], pose["pos"][1], pose["ori"]

    def now(self) -> float:
        """Unix seconds of the robot's clock, which in a simulation is the simulation's; news come once a second."""
        self.drain()
        return float(self._wait("/battery_state", lambda state: "secs" in state, lambda _: "the first news")["secs"])

    def _wait(self, topic: str, holds: Callable[[Json], bool], shown: Callable[[Json], str]) -> Json:
        try:
            return self.wait(topic, holds, PATIENCE, lambda seen: self._waiting(shown(seen)))
        except NotInTime as late:
            raise StoryError(f"not within {PATIENCE:g} s; {topic} is {late.seen}") from None


def _shown(move_type: str, remaining: float) -> str:
    """A move and the length of its path; there is none while the chassis docks."""
    return f"{move_type}, {remaining:.1f} m to go" if remaining > 0 else move_type
