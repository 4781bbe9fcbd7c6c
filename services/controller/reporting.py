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
        self.reset()

    def reset(self) -> None:
        """The next tick publishes a status."""
        self._slot = -1
        self._ticked: tuple[Dispatcher, ArmState, Array] | None = None

    def ticked(self, dispatcher: Dispatcher, state: ArmState, commanded: Array) -> None:
        """There was a tick that answers ``state``, for which the joints ``commanded`` (n,) had been asked."""
        if self._arm.now // STATUS_PERIOD_NS != self._slot or dispatcher.streaming:
            self._ticked = dispatcher, state, commanded

    def status(self) -> None:
        """As of the last tick, if it is due and not made yet: before anything else changes, but after the command is
        sent, for it costs more than the tick."""
        if self._ticked is None:
            return
        (dispatcher, state, commanded), self._ticked = self._ticked, None
        now = self._arm.now
        slot = now // STATUS_PERIOD_NS
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
