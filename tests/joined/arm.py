"""A controller core in a joined world, and CRF clients of it."""

from __future__ import annotations

import itertools
import json
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from rackhand.schemas import topics
from rackhand.schemas.motion import ArmCommand, ArmState, MotionEvent, MotionStatus
from rackhand.schemas.topics import Topic
from rackhand.schemas.world import Clock
from rackhand.services.controller import ik
from rackhand.services.controller.access.types import AccessConfig
from rackhand.services.controller.controller import Controller
from rackhand.services.controller.warm_up import Inline, warm_up
from tests.joined.checks import OK

if TYPE_CHECKING:
    from tests.joined.world import JoinedWorld

PERIOD_NS = 4_000_000


@cache
def warm_arm(kind: str) -> ik.Arm:
    arm = ik.load_arm(kind)
    warm_up(arm, PERIOD_NS)
    return arm


class JoinedArm:
    """Sessions ``a``, ``b`` … are clients. ``states``, ``commands`` and ``events`` are all of them, oldest first."""

    service, period_ns = "controller", PERIOD_NS

    def __init__(self, world: JoinedWorld, name: str, arm: ik.Arm, **access: Any) -> None:
        self.world, self.name, self.arm = world, name, arm
        epochs = itertools.count(1)
        self.core = Controller(self.arm, PERIOD_NS, Inline(), lambda: f"e{next(epochs)}", AccessConfig(**access))
        self.states: list[ArmState] = []
        self.sent: list[ArmCommand] = []
        self.events: list[MotionEvent] = []
        self.reported: MotionStatus | None = None
        self._answers: dict[int, dict[str, Any]] = {}
        self._tickets = itertools.count()

    # -- as the service does -----------------------------------------------------------------------------------------

    def begin(self) -> None:
        self.core.reset("driver restarted")

    def on_clock(self, clock: Clock) -> None:
        """A controller reads the time of its states."""

    def on_message(self, topic: Topic[Any], message: Any) -> None:
        if topic is not topics.ARM_STATE:
            return
        self.states.append(message)
        if message.stamp % PERIOD_NS == 0:
            command = self.core.tick(message, lockstep=True)
            self.sent.append(command)
            self.world.session.command(self.name, command)
        self._take()

    def _take(self) -> None:
        output = self.core.take()
        for ticket, text in output.replies:
            self._answers[ticket] = json.loads(text)  # type: ignore[index]
        self.events += output.events
        self.reported = output.status or self.reported
        assert not output.errors, output.errors

    # -- as a client does --------------------------------------------------------------------------------------------

    def send(self, session: str, text: str, stop: bool = False) -> dict[str, Any]:
        """The answer to the text of a request, which must come without time passing."""
        ticket = next(self._tickets)
        (self.core.stop_request if stop else self.core.request)(session, text, ticket)
        self.core.poll()
        self._take()
        assert ticket in self._answers, f"not answered at once: {text}"
        return self._answers.pop(ticket)

    def ask(self, session: str, stop: bool = False, /, **request: Any) -> dict[str, Any]:
        return self.send(session, json.dumps(request), stop)

    def ok(self, **request: Any) -> None:
        answer = self.ask("a", **{"priority": 10, **request})
        assert answer["message"] == OK, answer

    def status(self) -> dict[str, Any]:
        return dict(self.ask("watcher", command="getStatus")["message"])

    def advance(self, seconds: float) -> list[ArmState]:
        """Simulation time passes; every state that was measured in it."""
        before = len(self.states)
        self.world.advance(seconds)
        return self.states[before:]

    def commands(self) -> list[ArmCommand]:
        """Every command since the last call."""
        sent, self.sent = self.sent, []
        return sent

    def drive_to(self, q: np.ndarray[Any, np.dtype[np.float64]]) -> None:
        """To joint positions, and forget what was commanded."""
        self.ok(command="appendPath", type="joints", data=[q.tolist()])
        self.world.wait_for(lambda: None if self.status()["isTrajectoryRunning"]["value"] else True, "it is there")
        self.advance(0.5)
        self.commands()
