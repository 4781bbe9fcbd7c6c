"""Others who use a lift now and then: they call it, ride to another floor, and give it back. Seeded."""

from __future__ import annotations

import numpy as np

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.lift import CallLift, GoToFloor, LiftRequest, LiftState, ReleaseLift

CLIENT = "traffic"
BOARDING_NS = 3 * NANOSECONDS  # from open doors to the choice of a floor, and to leaving


class Traffic:
    """``per_minute``: calls, with exponential times between the end of one ride and the next call; 0 is none."""

    def __init__(self, floors: tuple[str, ...], per_minute: float, rng: np.random.Generator) -> None:
        self._floors, self._per_minute, self._rng = floors, per_minute, rng
        self._next = self._after(0)
        self._goal: str | None = None
        self._boarding: int | None = None
        self._riding = False

    def ask(self, state: LiftState) -> LiftRequest | None:
        """What they ask of the lift now; once a control step."""
        if self._next is None:
            return None
        if self._goal is None:
            return self._call() if state.stamp >= self._next else None
        if CLIENT not in (state.holder, *state.waiting):  # the lift was taken from them
            self._goal, self._boarding, self._riding = None, None, False
            self._next = self._after(state.stamp)
            return None
        if state.holder != CLIENT or state.door != "open":
            return None
        if self._boarding is None:
            self._boarding = state.stamp + BOARDING_NS
        if state.stamp < self._boarding:
            return None
        self._boarding = None
        if not self._riding:
            self._riding = True
            return LiftRequest(request=GoToFloor(client=CLIENT, floor=self._goal))
        self._goal, self._riding = None, False
        self._next = self._after(state.stamp)
        return LiftRequest(request=ReleaseLift(client=CLIENT))

    def _call(self) -> LiftRequest:
        begin, goal = self._rng.permutation(len(self._floors))[:2]
        self._goal = self._floors[goal]
        return LiftRequest(request=CallLift(client=CLIENT, floor=self._floors[begin]))

    def _after(self, stamp: int) -> int | None:
        if self._per_minute <= 0:
            return None
        return stamp + round(self._rng.exponential(60.0 / self._per_minute) * NANOSECONDS)
