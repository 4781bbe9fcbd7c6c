"""A robot's driver as a service on the bus hears it: is it there, is it still the same run, and what to answer."""

from __future__ import annotations

from typing import Literal

from rackhand.schemas.world import Clock


class DriverLink:
    """Notices that a driver has gone or begun anew. Methods return why all that was known is void, or None.

    Stamps of one topic never run backwards within a run, so one that does tells of a new run even before the clock.
    ``driver`` is how the driver is called in these texts.
    """

    def __init__(self, driver: str, period_ns: int) -> None:
        self.alive = False
        self.needs_join = False
        self.lockstep = False
        self._driver, self._period_ns = driver, period_ns
        self._present: bool | None = None
        self._run: str | None = None
        self._voided = False
        self._stamps: dict[str, int] = {}
        self._last: int | None = None

    def sample(self, topic: str, stamp: int) -> str | None:
        """A measurement has come."""
        if self._present is None:  # a driver without a liveliness token is there while it is heard
            self.alive = True
        backwards = stamp < self._stamps.get(topic, 0)
        if backwards:
            self._forget()
            self._voided = True
        self._stamps[topic] = stamp
        return f"{self._driver} began anew" if backwards else None

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
        self._forget()
        return f"{self._driver} began anew"

    def presence(self, alive: bool) -> str | None:
        """The simulator's liveliness token has appeared or gone."""
        self._present = self.alive = self.needs_join = alive
        if alive:
            return None
        self._run, self._voided, self.lockstep = None, False, False
        self._forget()
        return f"{self._driver} has gone"

    def asks(self, stamp: int) -> Literal["tick", "repeat", "skip"]:
        """What the measurement of ``stamp`` asks for: the first of each period a tick, which counts as done, and one
        that is told again its answer again."""
        if self._last is None or stamp // self._period_ns != self._last // self._period_ns:
            self._last = stamp
            return "tick"
        return "repeat" if stamp == self._last else "skip"

    def _forget(self) -> None:
        self._stamps.clear()
        self._last = None
