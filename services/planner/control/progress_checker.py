"""Whether a move makes progress: in which state it is stuck, and after how long it fails."""

from __future__ import annotations

from typing import Literal

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import StuckState
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.settings import NavigationSettings

Phase = Literal["planning", "driving", "rotating", "done"]
GAIN = 0.05  # m or rad that count as progress


class ProgressWatch:
    """Time since what is left last got smaller: the path in metres, or the angle of a turn on the spot in radians."""

    def __init__(self, settings: NavigationSettings, stamp: int) -> None:
        self._settings = settings
        self._best = float("inf")
        self._since = stamp
        self._what = ""

    def update(self, stamp: int, what: str, left: float) -> None:
        """``left`` of ``what``, a name; another name starts a new measure, but only progress resets the time."""
        if what != self._what:
            self._what, self._best = what, left
        elif left < self._best - GAIN:
            self._best, self._since = left, stamp

    def restart(self, stamp: int) -> None:
        self._since = stamp

    def renew(self) -> None:
        """The path was replaced: measure it from its own length."""
        self._what = ""

    def standing(self, stamp: int) -> float:
        """Seconds without progress."""
        return (stamp - self._since) / NANOSECONDS

    def stuck_state(self, stamp: int, phase: Phase) -> StuckState:
        if self.standing(stamp) < self._settings.stuck_after:
            return "none"
        return "target_spin_stucked" if phase == "rotating" else "move_stucked"

    def check(self, stamp: int, phase: Phase, text: str) -> None:
        """Raises ``MoveFailed`` (15, 18) after ``move_timeout`` or ``rotate_timeout``; ``text`` says why."""
        standing = self.standing(stamp)
        if phase == "rotating" and standing > self._settings.rotate_timeout:
            raise MoveFailed(MoveFailReason.ROTATE_TIMEOUT, f"no progress of the turn for {standing:.0f} s: {text}")
        if phase == "driving" and standing > self._settings.move_timeout:
            raise MoveFailed(MoveFailReason.MOVE_TIMEOUT, f"path exists, no progress for {standing:.0f} s: {text}")
