"""Whether a move makes progress: in which state it is stuck, and after how long it fails."""

from __future__ import annotations

import math
from typing import Literal

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.explain import Evidence
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import StuckState
from rackhand.services.planner.errors import MoveFailed, elapsed
from rackhand.services.planner.settings import NavigationSettings

Phase = Literal["planning", "driving", "rotating", "done"]
GAIN = 0.05  # m or rad that count as progress
MOVED = 0.01  # m by which a place must change to count as another
CRAWL = 0.1  # m/s; a move slower than this on average does not arrive, whatever it gains now and then
CRAWL_SHARE = 0.2  # of the speed limit, for chassis that may hardly move


class ProgressWatch:
    """Time since what is left last got smaller: the path in metres, or the angle of a turn on the spot in radians."""

    def __init__(self, settings: NavigationSettings, stamp: int) -> None:
        self._settings = settings
        self._best = float("inf")
        self._since = self._begun = stamp
        self._longest = 0.0
        self._what = ""

    def update(self, stamp: int, what: str, left: float) -> None:
        """``left`` of ``what``, a name; another name starts a new measure, but only progress resets the time."""
        self._longest = max(self._longest, left)
        if what != self._what:
            self._what, self._best = what, left
        elif left < self._best - GAIN:
            self._best, self._since = left, stamp

    def restart(self, stamp: int) -> None:
        """After a hold: the time it took does not count."""
        self._since = self._begun = stamp

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
            raise MoveFailed(
                MoveFailReason.ROTATE_TIMEOUT,
                f"no progress of the turn for {standing:.0f} s: {text}",
                _lasted("time without progress of the turn", standing, self._settings.rotate_timeout),
            )
        taken = (stamp - self._begun) / NANOSECONDS
        if phase in ("driving", "planning") and taken > self._longest_duration():
            what = f"not arrived after {taken:.0f} s, with at most {self._longest:.1f} m of path left at any time"
            evidence = _lasted("time of the move", taken, self._longest_duration())
            raise MoveFailed(MoveFailReason.MOVE_TIMEOUT, f"{what}: {text}", evidence)
        if phase == "driving" and standing > self._settings.move_timeout:
            raise MoveFailed(
                MoveFailReason.MOVE_TIMEOUT,
                f"path exists, no progress for {standing:.0f} s: {text}",
                _lasted("time without progress", standing, self._settings.move_timeout),
            )

    def _longest_duration(self) -> float:
        """Seconds after which a move counts as going to and fro: to lose ground and make it good again is progress to
        ``update``."""
        s = self._settings
        crawl = max(min(CRAWL, CRAWL_SHARE * s.control.max_forward_velocity), 1e-3)
        return max(s.move_timeout, s.planning_timeout) + s.move_timeout + self._longest / crawl


def _lasted(what: str, seconds: float, most: float) -> Evidence:
    return Evidence(measures=(elapsed(what, seconds, round(most, 2)),))


class RestWatch:
    """How long a chassis has been at the same place, on its way onto a dock or off it."""

    def __init__(self, stamp: int) -> None:
        self._since = stamp
        self._at: tuple[float, ...] = ()

    def restart(self, stamp: int) -> None:
        """After a hold: the time it took does not count."""
        self._since = stamp

    def update(self, stamp: int, *at: float) -> bool:
        """Whether ``at``, one or more coordinates in metres, is another place than before."""
        if self._at and math.dist(at, self._at) <= MOVED:
            return False
        self._at, self._since = at, stamp
        return True

    def standing(self, stamp: int) -> float:
        """Seconds at this place."""
        return (stamp - self._since) / NANOSECONDS
