"""Which measurements a control loop answers: one a period, by their stamps."""

from __future__ import annotations

from typing import Literal

NEAREST = 0.5  # usual gaps between two stamps: of those about the time that is expected, the nearest is answered
FOLLOWS = 0.1  # share by which what is expected, and what is usual, follows what is seen


class Periods:
    """Of ``period_ns``. The first measurement is answered, then what comes at the begin of a period, counted from 0: so
    it is in a simulator, whose stamps are exact.

    Stamps of real hardware jitter, and have any phase: what comes about when it is expected is followed slowly, and
    where it was lost the next one takes its place, but not its time. By fixed limits of periods measurements would be
    now before and now after them, as if one had been lost.
    """

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._expected = 0.0  # the stamp to answer next
        self._answered: int | None = None
        self._last: int | None = None
        self._usual_gap = 0.0  # ns; 0 while it is not known

    def due(self, stamp: int) -> Literal["tick", "repeat", "skip"]:
        """What the measurement of ``stamp`` asks for: one a period asks for a tick, which counts as done, and one that
        is published again for the same command again."""
        if stamp == self._answered:
            return "repeat"
        self._note_gap(stamp)
        late = stamp - self._expected
        if self._answered is None:
            self._expected = stamp // self._period_ns * self._period_ns
        elif late < -NEAREST * self._usual_gap:
            return "skip"
        else:
            self._follow(late)
        self._expected += self._period_ns
        self._answered = stamp
        return "tick"

    def _follow(self, late: float) -> None:
        """A measurement is answered that comes ``late`` ns after the one that is expected, or before it."""
        if late >= self._period_ns:
            lost, late = divmod(late, self._period_ns)
            self._expected += lost * self._period_ns
        if late <= NEAREST * self._usual_gap:  # else the one that was expected was lost
            self._expected += FOLLOWS * late

    def _note_gap(self, stamp: int) -> None:
        gap = 0 if self._last is None else min(stamp - self._last, self._period_ns)
        self._last = stamp
        if gap > 0:
            known = self._usual_gap or gap
            self._usual_gap = known + FOLLOWS * (gap - known)
