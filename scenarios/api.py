"""A client of the chassis API as a scenario needs one: requests over HTTP, and ``/planning_state`` over WebSocket."""

from __future__ import annotations

import json
from typing import Any

from rackhand.services.launch.api_connection import ApiConnection, Json, NoAnswer, NotInTime

PLANNING_STATE = "/planning_state"
FRAME_PATIENCE = 10.0  # s of wall time for a frame that must come


class ApiError(Exception):
    """An answer is not what was expected; the text is for the user."""


class Api(ApiConnection):
    """One connection to the gateway at ``url``, kept open. Raises ``ApiError`` where no gateway answers."""

    def __init__(self, url: str) -> None:
        super().__init__(url, [PLANNING_STATE])
        self.drain()  # the frames of a move that is posted now are read

    def ask(self, method: str, path: str, body: Any = None, status: int | None = None) -> Any:
        """The answer's JSON, None for an empty one. Raises ``ApiError`` unless it is a success, or has ``status``."""
        got, content = self.send(method, path, body)
        if got != status if status is not None else not 200 <= got < 300:
            wanted = "a success" if status is None else str(status)
            text = content.decode(errors="replace")[:300]
            raise ApiError(f"{method} {path}: status {got}, expected {wanted}: {text}")
        return json.loads(content) if content else None

    def send(self, method: str, path: str, body: Any = None) -> tuple[int, bytes]:
        """Status and content of the answer. Raises ``ApiError`` where there is none."""
        try:
            return super().send(method, path, body)
        except NoAnswer as error:
            raise ApiError(str(error)) from None

    # -- moves -------------------------------------------------------------------------------------------------------

    def post_move(self, body: Json) -> int:
        return int(self.ask("POST", "/chassis/moves", {"creator": "scenario", **body}, 201)["id"])

    def move(self, move_id: int) -> Json:
        return dict(self.ask("GET", f"/chassis/moves/{move_id}"))

    # -- frames ------------------------------------------------------------------------------------------------------

    def newest_state(self) -> Json:
        """The newest frame of ``/planning_state`` that has come; empty before the first."""
        self.drain()
        return self.seen.get(PLANNING_STATE, {})

    def final_state(self, move_id: int, state: str) -> Json:
        """The frame in which that move has this state; the newest one if none comes in time."""

        def is_it(frame: Json) -> bool:
            return (frame["action_id"], frame["move_state"]) == (move_id, state)

        try:
            return self.wait(PLANNING_STATE, is_it, FRAME_PATIENCE)
        except NotInTime as error:
            return error.seen or {}
