"""A client of the chassis API that reads nothing else: HTTP for orders, the WebSocket for what becomes of them."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import ExitStack
from types import TracebackType
from typing import Any

import httpx
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

Json = dict[str, Any]
PATIENCE = 240.0  # s of wall time; only ever bounds a failure
TOPICS = ("/planning_state", "/jack_state", "/robot_model", "/load_state", "/alerts", "/tracked_pose")


class ApiClient:
    """``seen`` is the newest frame of each topic."""

    def __init__(self, url: str) -> None:
        self._url = url
        self.http = httpx.Client(base_url=url, timeout=30.0, trust_env=False)
        self.seen: dict[str, Json] = {}
        self._socket: ClientConnection | None = None
        self._open = ExitStack()

    def __enter__(self) -> ApiClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.close()
        self.http.close()

    # -- orders ------------------------------------------------------------------------------------------------------

    def order(self, method: str, path: str, body: Json | None = None) -> Any:
        """The answer's JSON; fails unless it is a success."""
        answer = self.http.request(method, path, json=body)
        assert answer.is_success, f"{method} {path} -> {answer.status_code} {answer.text[:300]}"
        return answer.json()

    def service(self, name: str) -> None:
        assert self.order("POST", f"/services/{name}", {}) == {}

    def post(self, move_type: str, **fields: Any) -> int:
        return int(self.order("POST", "/chassis/moves", {"creator": "client", "type": move_type, **fields})["id"])

    def drive(self, move_type: str, **fields: Any) -> Json:
        """The move when it has ended, as ``/planning_state`` said."""
        return self.finish(self.post(move_type, **fields))

    def succeed(self, move_type: str, **fields: Any) -> None:
        move = self.drive(move_type, **fields)
        assert move["state"] == "succeeded", f"{move_type}: {move['fail_reason']} {move['fail_message']}"

    def finish(self, move: int) -> Json:
        self.wait(
            "/planning_state",
            lambda state: state["action_id"] == move and state["move_state"] in ("succeeded", "failed", "cancelled"),
            f"move {move} ends",
        )
        return dict(self.order("GET", f"/chassis/moves/{move}"))

    def jack(self, direction: str) -> None:
        """Until ``/jack_state`` says that it has arrived."""
        self.service(f"jack_{direction}")
        end = 1.0 if direction == "up" else 0.0
        self.wait(
            "/jack_state",
            lambda jack: jack["state"] == "hold" and abs(jack["progress"] - end) < 0.01,
            f"the jack is {direction}",
        )

    # -- frames ------------------------------------------------------------------------------------------------------

    def wait(self, topic: str, holds: Callable[[Json], bool], what: str) -> Json:
        """The newest frame of a topic, when something holds of it."""
        deadline = time.monotonic() + PATIENCE
        while topic not in self.seen or not holds(self.seen[topic]):
            assert time.monotonic() < deadline, f"{what}: not within {PATIENCE:g} s; seen {self.seen.get(topic)}"
            self._take(deadline - time.monotonic())
        return self.seen[topic]

    def _take(self, seconds: float) -> None:
        """The next frame; connects anew where the gateway was gone."""
        try:
            if self._socket is None:
                url = self._url.replace("http", "ws") + "/ws/v2/topics"
                self._socket = self._open.enter_context(connect(url, proxy=None, max_queue=None))
                self._socket.send(json.dumps({"enable_topic": list(TOPICS)}))
            frame = json.loads(self._socket.recv(timeout=max(seconds, 0.1)))
        except (ConnectionClosed, OSError) as error:
            if isinstance(error, TimeoutError):
                return
            self._socket = None
            time.sleep(0.1)
            return
        if "topic" in frame:
            self.seen[frame["topic"]] = frame
