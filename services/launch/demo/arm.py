"""A client of one arm over CRF's packet framing: requests, events, and paths that another client may interrupt."""

from __future__ import annotations

import itertools
import time
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Any

from rackhand.services.launch.demo.crf import CrfClient
from rackhand.services.launch.demo.errors import StoryError

Json = dict[str, Any]
POLL = 0.05  # s of wall time between two looks at the status
PATIENCE = 300.0  # s of wall time; only ever bounds a failure


class Interrupted(Exception):
    """Another client has taken control, and the path was not driven to its end."""


class ArmClient:
    """``priority``: the smaller the number, the higher. ``waiting`` is called with a text when there is news."""

    def __init__(self, address: str, name: str, priority: int, waiting: Callable[[str], None]) -> None:
        host, _, port = address.rpartition(":")
        self._crf = CrfClient(host, int(port))
        self.name, self._priority, self._waiting = name, priority, waiting
        self._ids = itertools.count(1)
        self._events: deque[Json] = deque()

    def __enter__(self) -> ArmClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._crf.__exit__(kind, error, trace)

    def ask(self, command: str, **fields: Any) -> Any:
        """The ``message`` of the answer. Raises ``StoryError`` where it is an error."""
        number = next(self._ids)
        self._crf.send({"command": command, "id": number, "client": self.name, **fields})
        while (answer := self._crf.receive()).get("id") != number:
            self._events.append(answer)
        if answer["replyCommand"] == "error":
            raise StoryError(f"{self.name}: {command} {fields}: {answer['message']} {answer.get('text', '')}")
        if isinstance(answer["message"], dict) and "text" in answer:
            return {**answer["message"], "text": answer["text"]}
        return answer["message"]

    def lock(self) -> bool:
        """Take control; False if another client keeps it, and this one then waits for it."""
        return self.ask("lockControl", priority=self._priority, keepAlive=120.0) is True

    def unlock(self) -> None:
        """Give control back."""
        if self.ask("unlockControl", priority=self._priority) is not True:
            raise StoryError(f"{self.name} did not hold control when it gave it back")

    def status(self) -> Json:
        return dict(self.ask("getStatus"))

    def joints(self) -> list[float]:
        """Measured, in radians."""
        return list(self.status()["jointPositions"]["value"])

    def start_joints(self, *waypoints: list[float]) -> None:
        """Start a path through joint positions (rad)."""
        self._controlled("appendPath", type="joints", data=list(waypoints))

    def start_tool(self, *poses: Json, straight: bool) -> None:
        """Start a path of the tool through CRF task poses in the frame of the base, straight or in joint space."""
        self._controlled("appendPath", type="task", data=list(poses), method=2 if straight else 1, reference=1)

    def finish(self) -> None:
        """Until the path is driven. Raises ``Interrupted``, and ``StoryError`` where a contact has stopped the arm."""
        deadline = time.monotonic() + PATIENCE
        while True:
            status = self.status()
            if self.heard("controlLost"):
                raise Interrupted
            if (status.get("contact") or {}).get("stopped"):
                raise StoryError(f"{self.name}: a contact stopped the arm: {status['contact']}")
            if not status["isTrajectoryRunning"]["value"]:
                return
            if time.monotonic() > deadline:
                raise StoryError(f"{self.name}: the path was not driven within {PATIENCE:g} s")
            self._waiting("the arm's path")
            time.sleep(POLL)

    def suction(self, on: bool) -> None:
        """Switch the gripper, and wait until it holds something, or nothing. Raises ``StoryError`` if it does not."""
        self._controlled("setGripper", suction=on)
        for _ in range(40):
            gripper = self.status()["gripper"]
            if gripper["holding"] == on:
                return
            self._waiting("the gripper to hold" if on else "the gripper to let go")
            time.sleep(POLL)
        raise StoryError(f"{self.name}: suction is {'on' if on else 'off'}, and the gripper reports {gripper}")

    def heard(self, event: str) -> bool:
        """Whether that event has come since it was last asked for; earlier ones are dropped."""
        while self._events:
            if self._events.popleft()["replyCommand"] == event:
                return True
        return False

    def wait_for_control(self) -> None:
        """Until control is granted to this client, which has asked for it."""
        deadline = time.monotonic() + PATIENCE
        while True:
            status = self.status()  # reads events too
            if self.heard("controlGranted") or status["priorityUnderControl"] == self._priority:
                return
            if time.monotonic() > deadline:
                raise StoryError(f"{self.name}: control was not granted; held with {status['priorityUnderControl']}")
            self._waiting(f"control, held by a client with priority {status['priorityUnderControl']}")
            time.sleep(POLL)

    def _controlled(self, command: str, **fields: Any) -> None:
        message = self.ask(command, priority=self._priority, **fields)
        if isinstance(message, dict) and message.get("value") is True:
            return
        if isinstance(message, dict) and message.get("code") in (403, 409):
            raise Interrupted
        raise StoryError(f"{self.name}: {command} was refused: {message}")
