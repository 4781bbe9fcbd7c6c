"""The chassis' driver as the planner hears it: is it there, is it still the same run, and which instants to answer."""

from __future__ import annotations

from typing import Literal

from schemas.world import Clock

PERIOD_NS = 40_000_000


class DriverLink:
    """Notices that a driver has gone or begun anew. Methods return why all that was known is void, or None.

    Stamps of one topic never run backwards within a run, so one that does tells of a new run even before the clock.
    """

    def __init__(self) -> None:
        self.alive = False
        self.needs_join = False
        self._present: bool | None = None
        self._run: str | None = None
        self._stamps: dict[str, int] = {}
        self._voided = False

    def sample(self, topic: str, stamp: int) -> str | None:
        """A measurement has come."""
        if self._present is None:  # a driver without a liveliness token is there while it is heard
            self.alive = True
        backwards = stamp < self._stamps.get(topic, 0)
        if backwards:
            self._stamps.clear()
            self._voided = True
        self._stamps[topic] = stamp
        return "the chassis' driver began anew" if backwards else None

    def clock(self, clock: Clock) -> str | None:
        if clock.run == self._run:
            return None
        first, self._run = self._run is None, clock.run
        if first:
            return None
        self.needs_join = self._present is True
        known, self._voided = self._voided, False
        if known:
            return None
        self._stamps.clear()
        return "the chassis' driver began anew"

    def presence(self, alive: bool) -> str | None:
        """The simulator's liveliness token has appeared or gone."""
        self._present = self.alive = self.needs_join = alive
        if alive:
            return None
        self._run, self._voided = None, False
        self._stamps.clear()
        return "the chassis' driver has gone"


class Ticker:
    """Which odometry is to be answered: the first of each period anew, and one that is told again, again."""

    def __init__(self, period_ns: int = PERIOD_NS) -> None:
        self._period_ns = period_ns
        self._last: int | None = None

    def reset(self) -> None:
        self._last = None

    def at(self, stamp: int) -> Literal["tick", "repeat", "skip"]:
        """What the odometry of ``stamp`` asks for; ``tick`` counts as done."""
        if self._last is None or stamp // self._period_ns != self._last // self._period_ns:
            self._last = stamp
            return "tick"
        return "repeat" if stamp == self._last else "skip"
