"""A client of the chassis API as a scenario needs one: requests over HTTP, and ``/planning_state`` over WebSocket."""

from __future__ import annotations

import http.client
import json
import time
from types import TracebackType
from typing import Any
from urllib.parse import urlsplit

from websockets.sync.client import ClientConnection, connect

Json = dict[str, Any]
TIMEOUT = 60.0  # s of wall time for an answer; only ever bounds a failure
FRAME_PATIENCE = 10.0  # s of wall time for a frame that must come


class ApiError(Exception):
    """An answer is not what was expected; the text is for the user."""


class Api:
    """One connection to the gateway at ``url``, kept open; no proxy is used."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        self._http = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=TIMEOUT)
        self._socket: ClientConnection = connect(f"ws://{parts.netloc}/ws/v2/topics", proxy=None, max_queue=None)
        self._socket.send(json.dumps({"enable_topic": ["/planning_state"]}))
        self.planning_state: Json = {}
        """The newest frame that was read by ``drain``."""

    def __enter__(self) -> Api:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.close()
        self._http.close()

    def ask(self, method: str, path: str, body: Any = None, status: int | None = None) -> Any:
        """The answer's JSON, None for an empty one. Raises ``ApiError`` unless it is a success, or has ``status``."""
        got, content = self.send(method, path, body)
        if got != status if status is not None else not 200 <= got < 300:
            wanted = "a success" if status is None else str(status)
            text = content.decode(errors="replace")[:300]
            raise ApiError(f"{method} {path}: status {got}, expected {wanted}: {text}")
        return json.loads(content) if content else None

    def send(self, method: str, path: str, body: Any = None) -> tuple[int, bytes]:
        """Status and content of the answer; a connection that the gateway has closed meanwhile is opened anew."""
        payload = None if body is None else json.dumps(body).encode()
        headers = {} if payload is None else {"content-type": "application/json"}
        for last in (False, True):
            try:
                self._http.request(method, path, payload, headers)
                answer = self._http.getresponse()
                return answer.status, answer.read()
            except TimeoutError:
                self._http.close()
                raise ApiError(f"{method} {path}: no answer within {TIMEOUT:g} s") from None
            except (http.client.RemoteDisconnected, ConnectionError) as error:
                self._http.close()
                if last:
                    raise ApiError(f"{method} {path}: the gateway does not answer: {error}") from None
        raise AssertionError("not reached")

    # -- moves -------------------------------------------------------------------------------------------------------

    def post_move(self, body: Json) -> int:
        return int(self.ask("POST", "/chassis/moves", {"creator": "scenario", **body}, 201)["id"])

    def move(self, move_id: int) -> Json:
        return dict(self.ask("GET", f"/chassis/moves/{move_id}"))

    # -- frames ------------------------------------------------------------------------------------------------------

    def drain(self) -> Json:
        """Read what has arrived; the newest frame of ``/planning_state``."""
        while (frame := self._frame(0.0)) is not None:
            self._take(frame)
        return self.planning_state

    def final_state(self, move_id: int, state: str) -> Json:
        """The frame in which that move has this state; the newest one if none comes in time."""
        deadline = time.monotonic() + FRAME_PATIENCE
        while (self.planning_state.get("action_id"), self.planning_state.get("move_state")) != (move_id, state):
            frame = self._frame(max(deadline - time.monotonic(), 0.0))
            if frame is None:
                break
            self._take(frame)
        return self.planning_state

    def _take(self, frame: Json) -> None:
        if frame.get("topic") == "/planning_state":
            self.planning_state = frame

    def _frame(self, seconds: float) -> Json | None:
        try:
            return dict(json.loads(self._socket.recv(timeout=seconds)))
        except TimeoutError:
            return None
