"""Carries out the one move that runs: starts it, holds it in an emergency stop, waits for what it cannot do without."""

from __future__ import annotations

from rackhand.schemas.base import NANOSECONDS, Pose2
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.interface import Navigator, Progress
from rackhand.services.planner.behaviors.procedures import Procedure, procedure_for
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.perception.chassis_state import Observation

PATIENCE_NS = 10 * NANOSECONDS


class MoveRunner:
    """One move at a time. After a hold the procedure starts anew from where the robot then is: it may have been pushed,
    and the time it stood must not count as being blocked.
    """

    def __init__(self, navigator: Navigator, patience_ns: int = PATIENCE_NS) -> None:
        self._navigator = navigator
        self._patience_ns = patience_ns
        self._forget(None)

    def _forget(self, request: MoveCreate | None) -> None:
        self._request = request
        self._procedure: Procedure | None = None
        self._driving = False
        self._begun = False
        self._waiting_since: int | None = None
        self.target: Pose2 | None = None

    def begin(self, request: MoveCreate) -> None:
        """Take a move; its work starts with the next ``step``, so that asking for it costs nothing."""
        self._forget(request)

    def step(
        self,
        seen: Observation | None,
        stamp: int,
        *,
        forbidden: MoveFailed | None = None,
        hold: bool = False,
        trouble: str | None = None,
    ) -> Progress | None:
        """One tick. None: stand still. Raises ``MoveFailed``.

        ``forbidden``: why no move of whatever type can go on. ``hold``: wait as long as it takes. ``trouble``: what the
        move cannot do without, and fails for if it lasts.
        """
        if self._request is None:
            return None
        if self._procedure is None:
            self._procedure = procedure_for(self._request)
        if forbidden is not None:
            raise forbidden
        if hold:
            self._driving, self._waiting_since = False, None
            return None
        if trouble is not None or seen is None:
            self._wait(trouble or "nothing has been measured", stamp)
            return None
        self._waiting_since = None
        if not self._driving and self._is_there(self._procedure, seen):
            return Progress(twist=STANDSTILL, arrived=True)
        return self._procedure.tick(self._navigator, seen)

    def _wait(self, trouble: str, stamp: int) -> None:
        self._driving = False
        if self._waiting_since is None:
            self._waiting_since = stamp
        if stamp - self._waiting_since >= self._patience_ns:
            text = f"{trouble}; the move stood for {self._patience_ns / NANOSECONDS:.0f} s"
            raise MoveFailed(MoveFailReason.PLATFORM_ALERT_ERROR, text)

    def _is_there(self, procedure: Procedure, seen: Observation) -> bool:
        """Start, or go on after a hold. True if the robot came to stand at the goal while it was being held."""
        if self.target is None:
            self.target = procedure.target(seen)
        try:
            procedure.start(self._navigator, seen)
        except MoveFailed as failed:
            if self._begun and failed.reason is MoveFailReason.STARTING_EQUAL_ENDING:
                return True
            raise
        self._driving = self._begun = True
        return False
