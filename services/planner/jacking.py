"""The jack: one order at a time, until the jack reports that it has arrived; and its self-check, up and down."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.chassis import CheckState, Jack
from rackhand.schemas.explain import Measure
from rackhand.schemas.refusal import RefusalCode, RequestRefused

Direction = Literal["up", "down"]
REACHED = 0.001
LOADED = 5.0  # kg on the jack from which on it carries something
TIME_LIMIT_NS = 40 * NANOSECONDS  # a whole stroke takes about 12 s


@dataclass(frozen=True)
class _Order:
    direction: Direction
    started: int | None = None


def jack_height(progress: float) -> Measure:
    """Of a jack that had to be down, as evidence. ``progress``: 0 to 1."""
    return Measure(name="height of the jack", value=round(progress, 3), expected=0.0)


class JackOrders:
    """Turns requests into jack commands. A jack that does not arrive in time is left where it is, and reported.

    ``failed``: what is wrong, until the next order or ``clear``. ``check_state``: the stage of the self-check while
    ``checking``, else its result; ``unknown`` after one that was interrupted.
    """

    def __init__(self) -> None:
        self._order: _Order | None = None
        self.failed: str | None = None
        self.checking = False
        self.check_state: CheckState = "no_error"

    @property
    def active(self) -> Direction | None:
        return None if self._order is None else self._order.direction

    def moving(self, jack: Jack | None) -> Direction | None:
        """Which way the jack is ordered to move, or moves without an order, as when a driver began it."""
        if self.active is not None or jack is None or not jack.state.startswith("jacking_"):
            return self.active
        return "up" if jack.state == "jacking_up" else "down"

    def request(self, direction: Direction, jack: Jack | None) -> str:
        """Take an order, in place of one still under way. Returns what will happen; ``RequestRefused`` if it cannot."""
        jack = _present(jack)
        self._stop_check()
        self.failed = None
        if _arrived(direction, jack):
            self._order = None
            return f"the jack is already {direction}"
        self._order = _Order(direction)
        return f"the jack moves {direction}, from {jack.progress:.0%}"

    def check(self, jack: Jack | None) -> str:
        """Begin a self-check. Returns what will happen; ``RequestRefused`` unless the jack is down."""
        jack = _present(jack)
        if not _arrived("down", jack):
            raise RequestRefused(RefusalCode.PRECONDITION, f"the jack is at {jack.progress:.0%}; lower it first")
        self.failed, self.checking, self.check_state = None, True, "up"
        self._order = _Order("up")
        return "the jack moves up and down again"

    def clear(self) -> str:
        """Forget what was wrong. Returns what that was."""
        text = "no error of the jack" if self.failed is None else f"cleared: {self.failed}"
        self.failed = None
        if not self.checking:
            self.check_state = "no_error"
        return text

    def command(self, jack: Jack | None, stamp: int, allowed: bool) -> Literal["hold", "up", "down"]:
        """The jack command at ``stamp``; ``hold`` while jacking is not allowed (still rolling, emergency stop)."""
        if self.checking and self.active == "up" and jack is not None and jack.weight >= LOADED:
            self._check_failed(f"{jack.weight:.0f} kg are on the jack, want less than {LOADED:g} kg")
            self._order = _Order("down")
        order = self._order
        if order is None:
            return "hold"
        if jack is not None and _arrived(order.direction, jack):
            self._order = self._next_of_check()
            return "hold"
        if not allowed:
            return "hold"
        if jack is not None and jack.stalled:
            self.failed = f"the jack stalled at {jack.progress:.0%} of its stroke under {jack.weight:.0f} kg: too heavy"
            self._order = None
            return "hold"
        if order.started is None:
            order = self._order = _Order(order.direction, stamp)
        if order.started is not None and stamp - order.started > TIME_LIMIT_NS:
            where = "nowhere known" if jack is None else f"at {jack.progress:.0%}"
            self.failed = (
                f"the jack did not move {order.direction} in time: it is {where} after {TIME_LIMIT_NS // NANOSECONDS} s"
            )
            if self.checking:
                self._check_failed(self.failed)
            self._order = None
            return "hold"
        return order.direction

    def forget(self) -> None:
        self._stop_check()
        self._order, self.failed = None, None

    def _next_of_check(self) -> _Order | None:
        """The order after one that has arrived."""
        if not self.checking:
            return None
        if self.check_state == "up":
            self.check_state = "down"
            return _Order("down")
        self.checking, self.check_state = False, "no_error"
        return None

    def _check_failed(self, text: str) -> None:
        self.checking, self.check_state = False, "error"
        self.failed = f"the self-check of the jack failed: {text}"

    def _stop_check(self) -> None:
        if self.checking:
            self.checking, self.check_state = False, "unknown"


def _present(jack: Jack | None) -> Jack:
    if jack is None:
        raise RequestRefused(RefusalCode.PRECONDITION, "this chassis reports no jack")
    return jack


def _arrived(direction: Direction, jack: Jack) -> bool:
    return jack.progress >= 1 - REACHED if direction == "up" else jack.progress <= REACHED
