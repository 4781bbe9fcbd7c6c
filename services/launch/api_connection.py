"""A connection to the chassis API for programs of this repository: requests over HTTP, frames over WebSocket."""

from __future__ import annotations

import http.client
import json
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from types import TracebackType
from typing import Any, Self
from urllib.parse import urlsplit

from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.sync.client import ClientConnection, connect

Json = dict[str, Any]
TIMEOUT = 60.0  # s of wall time for an answer; only ever bounds a failure
AGAIN = 0.1  # s between two attempts to reach a gateway that is gone


class NoAnswer(Exception):
    """The gateway does not answer; the text is for the user."""


class NotInTime(Exception):
    """What was waited for has not happened; ``seen`` is the newest frame of the topic, if there was one."""

    def __init__(self, seen: Json | None) -> None:
        super().__init__(f"the newest frame is {seen}")
        self.seen = seen


class ApiConnection:
    """``seen``: the newest frame of each WebSocket topic. No proxy is used, whatever the environment says.

    A connection that the gateway has closed, as one that was restarted has, is opened anew.
    """

    def __init__(self, url: str, topics: Sequence[str]) -> None:
        """``url``: of the gateway, ``http://host:port``; ``topics``: of the WebSocket, to be read."""
        parts = urlsplit(url)
        self._http = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=TIMEOUT)
        self._address, self._topics = f"ws://{parts.netloc}/ws/v2/topics", list(topics)
        self._open = ExitStack()  # holds the socket
        self._socket: ClientConnection | None = None
        self.seen: dict[str, Json] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._http.close()
        self._close_socket()

    # -- requests ----------------------------------------------------------------------------------------------------

    def send(self, method: str, path: str, body: Any = None) -> tuple[int, bytes]:
        """Status and content of the answer. Raises ``NoAnswer``."""
        payload = None if body is None else json.dumps(body).encode()
        headers = {} if payload is None else {"content-type": "application/json"}
        for last in (False, True):
            try:
                self._http.request(method, path, payload, headers)
                answer = self._http.getresponse()
                return answer.status, answer.read()
            except TimeoutError:
                self._http.close()
                raise NoAnswer(f"{method} {path}: no answer within {TIMEOUT:g} s") from None
            except (http.client.HTTPException, OSError) as error:
                self._http.close()
                if last:
                    raise NoAnswer(f"{method} {path}: the gateway does not answer: {error}") from None
        raise AssertionError("not reached")

    # -- frames ------------------------------------------------------------------------------------------------------

    def frame(self, seconds: float) -> Json | None:
        """The next frame, which is in ``seen`` then too; None if none comes within so many seconds of wall time."""
        try:
            if self._socket is None:
                self._socket = self._open.enter_context(connect(self._address, proxy=None, max_queue=None))
                self._socket.send(json.dumps({"enable_topic": self._topics}))
            frame = dict(json.loads(self._socket.recv(timeout=seconds)))
        except TimeoutError:
            return None
        except (ConnectionClosed, InvalidHandshake, OSError):
            self._close_socket()
            time.sleep(AGAIN)
            return None
        if "topic" in frame:
            self.seen[frame["topic"]] = frame
        return frame

    def _close_socket(self) -> None:
        self._socket = None
        self._open.close()

    def drain(self) -> None:
        """Read all frames that have come."""
        while self.frame(0.0) is not None:
            pass

    def wait(
        self,
        topic: str,
        holds: Callable[[Json], bool],
        patience: float,
        waiting: Callable[[Json], object] | None = None,
    ) -> Json:
        """The newest frame of a topic, when something holds of it; ``waiting`` gets it whenever it does not yet.

        Raises ``NotInTime`` after ``patience`` seconds of wall time.
        """
        deadline = time.monotonic() + patience
        while topic not in self.seen or not holds(self.seen[topic]):
            if waiting is not None and topic in self.seen:
                waiting(self.seen[topic])
            if (left := deadline - time.monotonic()) < 0:
                raise NotInTime(self.seen.get(topic))
            self.frame(left)
        return self.seen[topic]


def is_jack_at(jack: Json, direction: str) -> bool:
    """Whether a frame of ``/jack_state`` shows the jack at rest at the end that it was sent ``up`` or ``down`` to."""
    end = 1.0 if direction == "up" else 0.0
    return bool(jack["state"] == "hold" and abs(jack["progress"] - end) < 0.01)
