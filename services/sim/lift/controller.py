"""The controller of a lift: who has it, and when doors open, close and the cabin rides. No physics, no clock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.lift import (
    HOLD,
    PATIENCE,
    CallLift,
    Door,
    GetLift,
    GoToFloor,
    HoldDoor,
    LiftRequest,
    LiftState,
    ReleaseLift,
)
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.sim.errors import unknown

HOLD_NS, PATIENCE_NS = round(HOLD * NANOSECONDS), round(PATIENCE * NANOSECONDS)
REOPENED_NS = 2 * NANOSECONDS  # doors stay open so long after something was between them
SHUT, OPEN = 0.01, 0.99  # how far doors are open when they count as closed, and as open
OTHERS = "others"  # who has a lift that is taken


@dataclass
class _Call:
    client: str
    floor: str


class LiftController:
    """``floors``: their names, the cabin begins at the first. ``travel_ns``: of a ride from one to the next.

    ``handle`` answers requests at any time; ``step`` decides once a control step. ``doors_open`` is the command to the
    doors at ``floor``.
    """

    def __init__(self, floors: tuple[str, ...], travel_ns: int) -> None:
        self._floors, self._travel_ns = floors, travel_ns
        self.floor = floors[0]
        self.target: str | None = None
        self.door: Door = "closed"
        self.opening = 0.0
        self.blocked = False
        self.moving = False
        self._to, self._arrival = floors[0], 0
        self._to_open = False
        self._open_until = 0
        self._holder: _Call | None = None
        self._calls: list[_Call] = []
        self._heard = 0
        self._shut = False

    @property
    def doors_open(self) -> bool:
        return self.door in ("opening", "open")

    def state(self, stamp: int) -> LiftState:
        return LiftState(
            stamp=stamp,
            floor=self.floor,
            target=self.target,
            moving=self.moving,
            door=self.door,
            opening=self.opening,
            blocked=self.blocked,
            holder=None if self._holder is None else self._holder.client,
            waiting=tuple(call.client for call in self._calls),
        )

    # -- requests ----------------------------------------------------------------------------------------------------

    def handle(self, request: LiftRequest, stamp: int) -> LiftState:
        """The state after the request. Raises ``RequestRefused``, and has then changed nothing."""
        match request.request:
            case CallLift(client=client, floor=floor):
                self._check_floor(floor)
                self._call(client, floor, stamp)
            case HoldDoor(client=client):
                self._check_holder(client, stamp)
                self._open_until = stamp + HOLD_NS
                self._to_open = self.door == "closing" and self.target is None
            case GoToFloor(client=client, floor=floor):
                self._check_floor(floor)
                self._check_holder(client, stamp)
                self._bring(floor, stamp)
            case ReleaseLift(client=client):
                self._release(client)
            case GetLift():
                pass
        return self.state(stamp)

    def shut(self, shut: bool) -> None:
        """Fault: the doors close, whatever is between them, and the cabin stays."""
        self._shut = shut

    def take(self, taken: bool, stamp: int) -> None:
        """Fault: someone else has the lift; who had it waits for it."""
        if taken and not self._is_taken():
            if self._holder is not None:
                self._calls.insert(0, self._holder)
            self._holder, self._heard = _Call(OTHERS, self.floor), stamp
        elif not taken and self._is_taken():
            self._holder = None

    def _call(self, client: str, floor: str, stamp: int) -> None:
        if self._holder is not None and self._holder.client == client:
            self._heard = stamp
            self._bring(floor, stamp)
            return
        for call in self._calls:
            if call.client == client:
                call.floor = floor
                return
        self._calls.append(_Call(client, floor))
        self._serve_next(stamp)

    def _release(self, client: str) -> None:
        if self._holder is not None and self._holder.client == client:
            self._holder = None
        self._calls = [call for call in self._calls if call.client != client]

    def _bring(self, floor: str, stamp: int) -> None:
        """Ride there as soon as nothing is between the doors, or open them here. A ride under way goes to its end."""
        if floor == self.floor and not self.moving:
            self.target, self._to_open, self._open_until = None, self.door != "open", stamp + HOLD_NS
        else:
            self.target, self._to_open, self._open_until = floor, False, stamp

    def _check_floor(self, floor: str) -> None:
        if floor not in self._floors:
            raise unknown("floor", floor, self._floors)

    def _check_holder(self, client: str, stamp: int) -> None:
        if self._holder is None or self._holder.client != client:
            has = "nobody has it; call it first" if self._holder is None else f"{self._holder.client!r} has it"
            raise RequestRefused(RefusalCode.PRECONDITION, f"{client!r} does not have the lift: {has}")
        self._heard = stamp

    def _is_taken(self) -> bool:
        return self._holder is not None and self._holder.client == OTHERS

    # -- once a control step -----------------------------------------------------------------------------------------

    def step(self, stamp: int, opening: float, blocked: bool) -> Literal["stay", "arrive"]:
        """``opening``: how far the doors at ``floor`` are open; ``blocked``: something is between them. ``arrive``: the
        cabin has come to ``floor`` now, with all that is in it."""
        self.opening, self.blocked = opening, blocked
        if self.moving:
            return self._ride(stamp)
        if self._holder is not None and not self._is_taken() and stamp - self._heard > PATIENCE_NS:
            self._holder = None
        self._serve_next(stamp)
        self._move_doors(stamp)
        return "stay"

    def _ride(self, stamp: int) -> Literal["stay", "arrive"]:
        if stamp < self._arrival:
            return "stay"
        self.floor, self.moving = self._to, False
        if self.target == self.floor:
            self.target, self._to_open = None, True
        return "arrive"

    def _depart(self, target: str, stamp: int) -> None:
        """To the next floor in that direction."""
        here, there = self._floors.index(self.floor), self._floors.index(target)
        self._to, self._arrival = self._floors[here + (1 if there > here else -1)], stamp + self._travel_ns
        self.moving = True

    def _serve_next(self, stamp: int) -> None:
        if self._holder is None and self._calls:
            self._holder, self._heard = self._calls.pop(0), stamp
            self._bring(self._holder.floor, stamp)

    def _move_doors(self, stamp: int) -> None:
        leaves = self.target is not None and self.target != self.floor
        match self.door:
            case "opening" if self._shut:
                self.door = "closing"
            case "opening" if self.opening >= OPEN:
                self.door, self._to_open = "open", False
                self._open_until = max(self._open_until, stamp + (0 if leaves else HOLD_NS))
            case "open" if self._shut or (not self.blocked and stamp >= self._open_until):
                self.door = "closing"
            case "closing" if self._to_open and not self._shut:
                self.door = "opening"
            case "closing" if self.blocked and not self._shut:
                self.door = "opening"
                self._open_until = stamp + REOPENED_NS
            case "closing" if self.opening <= SHUT:
                self.door = "closed"
            case "closed" if self._to_open and not self._shut:
                self.door = "opening"
            case "closed" if self.target is not None and leaves and not self._shut:
                self._depart(self.target, stamp)
            case _:
                pass
