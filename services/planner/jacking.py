"""The jack: one order at a time, until the jack reports that it has arrived."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.chassis import Jack
from rackhand.schemas.refusal import RefusalCode, RequestRefused

Direction = Literal["up", "down"]
REACHED = 0.001
TIME_LIMIT_NS = 40 * NANOSECONDS  # a whole stroke takes about 12 s


@dataclass(frozen=True)
class _Order:
    direction: Direction
    started: int | None = None


class JackOrders:
    """Turns a request into jack commands. A jack that does not arrive in time is left where it is, and reported."""

    def __init__(self) -> None:
        self._order: _Order | None = None
        self.failed: str | None = None

    @property
    def active(self) -> Direction | None:
        return None if self._order is None else self._order.direction

    def request(self, direction: Direction, jack: Jack | None) -> str:
        """Take an order, in place of one still under way. Returns what will happen; ``RequestRefused`` if it cannot."""
        if jack is None:
            raise RequestRefused(RefusalCode.PRECONDITION, "this chassis reports no jack")
        self.failed = None
        if _arrived(direction, jack):
            self._order = None
            return f"the jack is already {direction}"
        self._order = _Order(direction)
        return f"the jack moves {direction}, from {jack.progress:.0%}"

    def command(self, jack: Jack | None, stamp: int, allowed: bool) -> Literal["hold", "up", "down"]:
        """The jack command at ``stamp``; ``hold`` while jacking is not allowed (still rolling, emergency stop)."""
        order = self._order
        if order is None:
            return "hold"
        if jack is not None and _arrived(order.direction, jack):
            self._order = None
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
            self._order = None
            return "hold"
        return order.direction

    def forget(self) -> None:
        self._order, self.failed = None, None


def _arrived(direction: Direction, jack: Jack) -> bool:
    return jack.progress >= 1 - REACHED if direction == "up" else jack.progress <= REACHED
