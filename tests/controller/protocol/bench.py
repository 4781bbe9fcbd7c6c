"""A dispatcher on a bench: a six-joint arm that executes every command at once."""

from __future__ import annotations

import json
from typing import Any

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.motion import Expected, MotionStatus, RobotConfiguration
from rackhand.services.controller.access.access import Access
from rackhand.services.controller.access.types import SECOND, AccessConfig, StopMotion
from rackhand.services.controller.commands.spec import CommandTable, GrantedCommand
from rackhand.services.controller.commands.table import COMMANDS
from rackhand.services.controller.protocol.dispatch import Dispatcher, DispatchResult
from tests.schemas.test_motion import configuration, status

ARM = RobotConfiguration.model_validate(configuration())
IDLE = MotionStatus.model_validate(status(priorityUnderControl=0, controllerStatus=[200]))


class Bench:
    """Sends requests and reads answers as dictionaries. ``queue`` is the arm's: points not yet run."""

    def __init__(
        self, not_offered: frozenset[str] = frozenset(), commands: CommandTable = COMMANDS, **config: Any
    ) -> None:
        access = Access("e1", AccessConfig(**config))
        self.dispatcher = Dispatcher(access, lambda: ARM, commands, not_offered)
        self.now = 0
        self.queue: list[Any] = []
        self.turn = DispatchResult()

    def ask(self, client: str, /, **request: Any) -> dict[str, Any]:
        return self.send(client, json.dumps(request))

    def send(self, client: str, text: bytes | str) -> dict[str, Any]:
        self.take(self.dispatcher.request(client, text, self.now))
        answer = self.turn.reply if self.turn.granted is None else self.carry_out(self.turn.granted)
        assert answer is not None, "left without an answer"
        read: dict[str, Any] = json.loads(answer)
        assert read["command"] == "reply"
        return read

    def wait(self, seconds: float) -> None:
        self.now += int(seconds * SECOND)
        self.take(self.dispatcher.tick(self.now))

    def take(self, turn: DispatchResult) -> None:
        self.turn = turn
        if any(isinstance(effect, StopMotion) for effect in turn.motion):
            self.queue.clear()

    def carry_out(self, granted: GrantedCommand) -> bytes:
        if isinstance(granted.request, crf.GetStatus):
            return self.dispatcher.finish(granted, self.dispatcher.complete(IDLE, self.now), self.now)
        if isinstance(granted.request, crf.AppendJointsPath | crf.AppendTaskPath):
            self.queue.extend(granted.request.data)
        return self.dispatcher.finish(granted, Expected[bool].of(True), self.now)


PATH: dict[str, Any] = {"command": "appendPath", "priority": 10, "type": "joints", "data": [[0, 0, 0, 0, 0, 0]]}
OK = {"value": True, "code": 200, "detail": 0}
BAD = {"code": 400, "detail": 0}
