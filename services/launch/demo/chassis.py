"""A client of the chassis API: HTTP for orders, the WebSocket for what becomes of them."""

from __future__ import annotations

import json
import math
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from types import TracebackType
from typing import Any

from websockets.sync.client import connect

from rackhand.services.launch.demo.errors import StoryError

Json = dict[str, Any]
TOPICS = ("/planning_state", "/jack_state", "/battery_state", "/load_state")
ENDED = ("succeeded", "failed", "cancelled")
PATIENCE = 600.0  # s of wall time; only ever bounds a failure
HTTP_TIMEOUT = 30.0

# Loopback is never behind a proxy, whatever the environment says.
_opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))


class ChassisClient:
    """``waiting`` is called with a text when there is news of what is waited for."""

    def __init__(self, url: str, waiting: Callable[[str], None]) -> None:
        self._url, self._waiting = url, waiting
        self._socket = connect(url.replace("http", "ws", 1) + "/ws/v2/topics", proxy=None, max_queue=None)
        self._socket.send(json.dumps({"enable_topic": list(TOPICS)}))
        self._seen: dict[str, Json] = {}

    def __enter__(self) -> ChassisClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.close()

    def request(self, method: str, path: str, body: Json | None = None) -> Any:
        """The answer's JSON. Raises ``StoryError`` with the reason of a refusal."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self._url + path, data, {"content-type": "application/json"}, method=method)
        try:
            with _opener.open(request, timeout=HTTP_TIMEOUT) as answer:
                return json.loads(answer.read())
        except urllib.error.HTTPError as error:
            text = error.read().decode(errors="replace")
            raise StoryError(f"{method} {path} {body}: status {error.code}: {text[:300]}") from None
        except OSError as error:
            raise StoryError(f"{method} {path}: no answer: {error}") from None

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
        end, load = (1.0, "carrying") if direction == "up" else (0.0, "under_rack")
        self.request("POST", f"/services/jack_{direction}", {})
        self._wait(
            "/jack_state",
            lambda jack: jack["state"] == "hold" and abs(jack["progress"] - end) < 0.01,
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
        self._take(0.0)
        while "/battery_state" not in self._seen:
            self._take(1.0)
        return float(self._seen["/battery_state"]["secs"])

    def _wait(self, topic: str, holds: Callable[[Json], bool], shown: Callable[[Json], str]) -> Json:
        deadline = time.monotonic() + PATIENCE
        while topic not in self._seen or not holds(self._seen[topic]):
            if time.monotonic() > deadline:
                raise StoryError(f"not within {PATIENCE:g} s; {topic} is {self._seen.get(topic)}")
            if topic in self._seen:
                self._waiting(shown(self._seen[topic]))
            self._take(1.0)
        return self._seen[topic]

    def _take(self, seconds: float) -> None:
        """All frames that have come; waits so long for a first one."""
        try:
            while True:
                frame = json.loads(self._socket.recv(timeout=seconds))
                if "topic" in frame:
                    self._seen[frame["topic"]] = frame
                seconds = 0.0
        except TimeoutError:
            return


def _shown(move_type: str, remaining: float) -> str:
    """A move and the length of its path; there is none while the chassis docks."""
    return f"{move_type}, {remaining:.1f} m to go" if remaining > 0 else move_type
