"""A toy move type: turn for ``properties.seconds``."""

from __future__ import annotations

from rackhand.schemas.base import Twist2
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.base import Behavior, Context, Done, Drive, Status


def for_request(request: MoveCreate) -> Behavior:
    return ToyTurn(round(request.properties["seconds"] / 0.04))


class ToyTurn:
    def __init__(self, ticks: int) -> None:
        self._left = ticks

    def step(self, _ctx: Context) -> Drive | Done:
        self._left -= 1
        return Drive(Twist2(linear=0.0, angular=0.5)) if self._left >= 0 else Done()

    def resume(self, _ctx: Context) -> None: ...

    def status(self) -> Status:
        return Status(intent="turn")
