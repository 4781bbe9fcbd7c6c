"""A client of the chassis API that reads nothing else: HTTP for orders, the WebSocket for what becomes of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from rackhand.schemas.moves import TERMINAL
from rackhand.services.launch.api_connection import ApiConnection, Json, NotInTime, is_jack_at

PATIENCE = 240.0  # s of wall time; only ever bounds a failure
TOPICS = ("/planning_state", "/jack_state", "/robot_model", "/load_state", "/alerts", "/tracked_pose")


class ApiClient(ApiConnection):
    """``seen`` is the newest frame of each topic."""

    def __init__(self, url: str) -> None:
        super().__init__(url, TOPICS)

    # -- orders ------------------------------------------------------------------------------------------------------

    def order(self, method: str, path: str, body: Json | None = None) -> Any:
        """The answer's JSON; fails unless it is a success."""
        status, content = self.send(method, path, body)
        assert 200 <= status < 300, f"{method} {path} -> {status} {content[:300]!r}"
        return json.loads(content)

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
        self.see(
            "/planning_state",
            lambda state: state["action_id"] == move and state["move_state"] in TERMINAL,
            f"move {move} ends",
        )
        return dict(self.order("GET", f"/chassis/moves/{move}"))

    def jack(self, direction: str) -> None:
        """Until ``/jack_state`` says that it has arrived."""
        self.service(f"jack_{direction}")
        self.see("/jack_state", lambda jack: is_jack_at(jack, direction), f"the jack is {direction}")

    # -- frames ------------------------------------------------------------------------------------------------------

    def see(self, topic: str, holds: Callable[[Json], bool], what: str) -> Json:
        """The newest frame of a topic, when something holds of it."""
        try:
            return self.wait(topic, holds, PATIENCE)
        except NotInTime as late:
            raise AssertionError(f"{what}: not within {PATIENCE:g} s; seen {late.seen}") from None
