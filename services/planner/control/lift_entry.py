"""Rules of driving into a lift: what the chassis waits for, for how long, and what the move then fails with.

==== ============================== ===================================================================================
  #  reason                         raised
==== ============================== ===================================================================================
300  elevator_point_occupied        no progress for 10 s, and something is where the chassis is to stand
301  elevator_closed                the door has been closed for 3 s before the chassis is in the doorway
302  elevator_point_obscured_       for 20 s something hid where the chassis is to stand
     timeout
303  elevator_point_occupancy_      for 10 s the scans did not show whether the place is free, and nothing hid it:
     detection_timeout              walls, or no measurement
304  elevator_enter_progress_       no progress for 10 s, and the place is not occupied
     update_timeout
==== ============================== ===================================================================================

While the place is hidden or unknown, or the door closed or closing, the chassis stops. While it is occupied, the
chassis stops for 3 s and then goes on as far as there is room. Its state says so, and after 3 s without progress.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.errors import MoveFailed, elapsed

DOOR_GRACE = 3.0  # s that a door may be closed
UNKNOWN_FOR, OBSCURED_FOR = 10.0, 20.0  # s
OCCUPIED_STOP = 3.0  # s
ANNOUNCED_AFTER, PROGRESS_WITHIN = 3.0, 10.0  # s without progress
NEAR_ENOUGH = 0.2  # m from the place, where a chassis that gets no nearer has arrived

PointState = Literal["free", "occupied", "obscured", "unknown"]
"""Of the place in the cabin where the chassis is to stand."""
DoorState = Literal["open", "closing", "closed"]
Whereabouts = Literal["outside", "in_doorway", "inside"]
"""Of the whole body: before the doors, partly between or behind them, or in the cabin."""


@dataclass(frozen=True)
class LiftView:
    """What is seen of a lift at ``stamp`` (ns). ``away``: metres from the chassis to its place; ``standing``: seconds
    without progress since it may drive. ``blocked``: an obstacle keeps it from driving."""

    stamp: int
    where: Whereabouts
    point: PointState
    door: DoorState
    away: float
    standing: float
    blocked: bool = False


@dataclass(frozen=True)
class Entry:
    """What follows: drive or wait, or arrived. ``notice`` says why there is no progress, empty while there is."""

    drive: bool = True
    arrived: bool = False
    notice: str = ""


class _Timer:
    """Seconds for which something has been so."""

    def __init__(self) -> None:
        self._since: int | None = None

    def run(self, so: bool, stamp: int) -> float:
        if not so:
            self._since = None
        elif self._since is None:
            self._since = stamp
        return 0.0 if self._since is None else (stamp - self._since) / NANOSECONDS


class EntryRules:
    """``decide`` once a tick."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """After a hold: the time it took does not count."""
        self._closed, self._occupied = _Timer(), _Timer()
        self._hidden: dict[PointState, float] = {}
        self._last: int | None = None

    def decide(self, view: LiftView) -> Entry:
        """Raises ``MoveFailed``."""
        passed = 0.0 if self._last is None else (view.stamp - self._last) / NANOSECONDS
        self._last = view.stamp
        if (waits := self._door(view)) is not None:
            return waits
        if (waits := self._sight(view, passed)) is not None:
            return waits
        if view.where == "inside" and view.away <= NEAR_ENOUGH and view.standing > ANNOUNCED_AFTER:
            return Entry(drive=False, arrived=True)
        occupied = self._occupied.run(view.point == "occupied", view.stamp)
        if view.point == "occupied" and occupied < OCCUPIED_STOP:
            return Entry(drive=False, notice="the place in the lift is occupied")
        return self._progress(view)

    def _door(self, view: LiftView) -> Entry | None:
        """A chassis between doors that close drives on: that is the shorter way out of them."""
        outside = view.where == "outside"
        lasted = self._closed.run(outside and view.door == "closed", view.stamp)
        if lasted > DOOR_GRACE:
            text = f"the lift's door was closed for {lasted:.0f} s"
            raise _failed(MoveFailReason.ELEVATOR_CLOSED, text, "time that the door was closed", lasted, DOOR_GRACE)
        return Entry(drive=False, notice=f"the lift's door is {view.door}") if outside and view.door != "open" else None

    def _sight(self, view: LiftView, passed: float) -> Entry | None:
        """Times add up until the place is seen again: what is hidden now may be unknown a moment later."""
        if view.point not in ("obscured", "unknown"):
            self._hidden.clear()
            return None
        lasted = self._hidden[view.point] = self._hidden.get(view.point, -passed) + passed
        if view.point == "obscured":
            if lasted > OBSCURED_FOR:
                text = f"something hid the place in the lift for {lasted:.0f} s"
                reason = MoveFailReason.ELEVATOR_POINT_OBSCURED_TIMEOUT
                raise _failed(reason, text, "time that the place was hidden", lasted, OBSCURED_FOR)
            return Entry(drive=False, notice="something hides the place in the lift")
        if lasted > UNKNOWN_FOR:
            text = f"for {lasted:.0f} s the scans did not show whether the place in the lift is free"
            reason = MoveFailReason.ELEVATOR_POINT_OCCUPANCY_DETECTION_TIMEOUT
            raise _failed(reason, text, "time that the place was not seen", lasted, UNKNOWN_FOR)
        return Entry(drive=False, notice="the scans do not show whether the place in the lift is free")

    def _progress(self, view: LiftView) -> Entry:
        occupied = view.point == "occupied"
        if view.standing > PROGRESS_WITHIN:
            stood = f"no progress for {view.standing:.0f} s, {view.away:.2f} m from the place in the lift"
            if occupied:
                reason, text = MoveFailReason.ELEVATOR_POINT_OCCUPIED, f"{stood}, which is occupied"
            else:
                why = "blocked by an obstacle" if view.blocked else "the chassis does not follow velocity commands"
                reason, text = MoveFailReason.ELEVATOR_ENTER_PROGRESS_UPDATE_TIMEOUT, f"{stood}: {why}"
            raise _failed(reason, text, "time without progress", view.standing, PROGRESS_WITHIN)
        if occupied:
            return Entry(notice="the place in the lift is occupied: entering as far as there is room")
        return Entry(notice="no progress into the lift" if view.standing > ANNOUNCED_AFTER else "")


def _failed(reason: MoveFailReason, text: str, what: str, seconds: float, most: float) -> MoveFailed:
    return MoveFailed(reason, text).about(measures=(elapsed(what, seconds, most),))
