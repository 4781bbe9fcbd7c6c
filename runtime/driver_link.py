"""A robot's driver as a service on the bus sees it: is it connected, is it still the same run, what to answer."""

from __future__ import annotations

from typing import Literal

from rackhand.runtime.periods import Periods
from rackhand.schemas.world import Clock

SILENCE = 1.5  # s of monotonic time without a measurement until a driver counts as silent, at speed 1 or more


class DriverLink:
    """Notices that a driver disconnected, fell silent or restarted.

    Methods return why all measurements so far are void, or None. ``now`` is monotonic time in seconds: liveness is the
    only thing that is measured by it. ``driver`` is how texts call the driver, as in "the chassis driver".

    A driver is alive while its liveliness token is there (one without a token: while it publishes) and its last
    measurement is not older than ``SILENCE``. A paused world publishes its clock in place of measurements, a slow one
    is given proportionally longer. In lockstep the world waits for its participants for as long as they take, and the
    run must not depend on the machine's clock: there, only the token counts.

    Stamps of one topic never run backwards within a run, so one that does shows a new run even before the clock.
    """

    def __init__(self, driver: str, period_ns: int) -> None:
        self.lockstep = False
        self.fault = f"{driver} is not connected"  # why it is not alive; "" while it is
        self._driver, self._period_ns = driver, period_ns
        self._periods = Periods(period_ns)
        self._present: bool | None = None
        self._last_sign = 0.0  # monotonic time of the last sign of life
        self._timeout = SILENCE
        self._paused = False
        self._run: str | None = None
        self._voided = False
        self._stamps: dict[str, int] = {}

    @property
    def alive(self) -> bool:
        return not self.fault

    def measured(self, topic: str, stamp: int, now: float, from_driver: bool = True) -> str | None:
        """A measurement was received. Those that are not ``from_driver`` (a localiser's) are no sign of life of it."""
        if from_driver and self._present is not False:
            self._last_sign, self.fault = now, ""
        backwards = stamp < self._stamps.get(topic, 0)
        if backwards:
            self._forget()
            self._voided = True
        self._stamps[topic] = stamp
        return f"{self._driver} restarted" if backwards else None

    def clock(self, clock: Clock, now: float) -> str | None:
        self.lockstep = clock.lockstep
        self._timeout = SILENCE / min(1.0, clock.speed or 1.0)
        if clock.paused or self._paused:
            self._last_sign = now
        self._paused = clock.paused
        if clock.run == self._run:
            self._voided = False
            return None
        first, self._run = self._run is None, clock.run
        known, self._voided = self._voided, False
        if first or known:
            return None
        self._forget()
        return f"{self._driver} restarted"

    def presence(self, alive: bool, now: float) -> str | None:
        """The driver's liveliness token has appeared or disappeared."""
        self._present = alive
        if alive:
            self._last_sign, self.fault = now, ""
            return None
        self._run, self._voided, self.lockstep, self._paused = None, False, False, False
        return self._lost(f"{self._driver} disconnected")

    def check(self, now: float) -> str | None:
        """To be called when everything that was received has been handled."""
        left = self.seconds_left(now)
        if left is None or left > 0:
            return None
        self._voided = True
        return self._lost(f"{self._driver} sent no measurement for {self._timeout:.1f} s")

    def seconds_left(self, now: float) -> float | None:
        """How long the driver may go on being silent; None while there is nothing to wait for."""
        return None if self.fault or self.lockstep else self._last_sign + self._timeout - now

    def due(self, stamp: int) -> Literal["tick", "repeat", "skip"]:
        """What the measurement of ``stamp`` asks for; see ``Periods``."""
        return self._periods.due(stamp)

    def _lost(self, why: str) -> str:
        self.fault = why
        self._forget()
        return why

    def _forget(self) -> None:
        self._stamps.clear()
        self._periods = Periods(self._period_ns)
