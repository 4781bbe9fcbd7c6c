"""The arm's driver as the controller hears it: is it there, is it still the same run, and which states to answer."""

from __future__ import annotations

from typing import Literal

from schemas.world import Clock


class DriverLink:
    """Notices that a driver has gone or begun anew. Methods return why all that was known is void, or None.

    Stamps never run backwards within a run, so one that does tells of a new run even before the clock.
    """

    def __init__(self, period_ns: int) -> None:
        self.needs_join = False
        self.lockstep = False
        self._period_ns = period_ns
        self._present: bool | None = None
        self._run: str | None = None
        self._voided = False
        self._newest = 0
        self._last: int | None = None

    def state(self, stamp: int) -> str | None:
        """A state has come."""
        backwards, self._newest = stamp < self._newest, stamp
        if not backwards:
            return None
        self._voided, self._last = True, None
        return "the arm's driver began anew"

    def clock(self, clock: Clock) -> str | None:
        self.lockstep = clock.lockstep
        if clock.run == self._run:
            return None
        first, self._run = self._run is None, clock.run
        if first:
            return None
        self.needs_join = self._present is True
        known, self._voided = self._voided, False
        if known:
            return None
        self._newest, self._last = 0, None
        return "the arm's driver began anew"

    def presence(self, alive: bool) -> str | None:
        """The simulator's liveliness token has appeared or gone."""
        self._present = self.needs_join = alive
        if alive:
            return None
        self._run, self._voided, self._newest, self._last = None, False, 0, None
        self.lockstep = False
        return "the arm's driver has gone"

    def asks(self, stamp: int) -> Literal["tick", "repeat", "skip"]:
        """What the state of ``stamp`` asks for: the first of each period a tick, one told again its answer again."""
        if self._last is None or stamp // self._period_ns != self._last // self._period_ns:
            self._last = stamp
            return "tick"
        return "repeat" if stamp == self._last else "skip"
