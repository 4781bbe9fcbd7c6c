"""What a controller publishes of itself: status, status streams, diagnostics, the path ahead."""

from __future__ import annotations

from rackhand.schemas.arrays import Array
from rackhand.schemas.motion import ArmState
from rackhand.services.controller.arm_control import ArmControl
from rackhand.services.controller.motion.loop_watch import LoopWatch
from rackhand.services.controller.motion.meter import Stopwatch
from rackhand.services.controller.outputs import Outbox
from rackhand.services.controller.protocol.dispatch import Dispatcher

STATUS_PERIOD_NS = 40_000_000


class Reporter:
    """Writes to ``outbox``. It decides nothing that moves the arm."""

    def __init__(self, arm: ArmControl, stopwatch: Stopwatch, outbox: Outbox) -> None:
        self._arm, self._outbox = arm, outbox
        self.watch = LoopWatch(arm.motion, stopwatch)
        self._slot = -1

    def reset(self) -> None:
        """The next tick publishes a status."""
        self._slot = -1

    def status(self, dispatcher: Dispatcher, state: ArmState, commanded: Array) -> None:
        """After a tick that answers ``state``, for which the joints ``commanded`` (n,) had been asked."""
        now = self._arm.now
        slot = now // STATUS_PERIOD_NS
        if slot == self._slot and not dispatcher.streaming:
            return  # making a status costs more than the rest of a tick
        status, output = self._arm.status(), self._outbox.output
        output.streams.extend((session, text.decode()) for session, text in dispatcher.due(status, now))
        if slot != self._slot:
            self._slot = slot
            output.status = status
            output.diagnostics = self.watch.diagnostics(state, commanded)

    def path(self) -> None:
        """The path ahead, if it has changed."""
        output = self._outbox.output
        output.path = self.watch.changed_path(self._arm.now) or output.path
