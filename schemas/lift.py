"""A lift that clients call: its requests and its state. Any lift controller may serve them; in a simulated cell it is
the simulator.

One client at a time has the lift; calls of others wait in their order. A ride of a robot::

    call  floor1   → until ``holder`` is the client, ``floor`` is floor1 and ``door`` is ``open``; drive in, meanwhile
    hold           → again and again, at least every ``HOLD`` seconds, as long as the doors must stay open
    go    floor2   → until ``floor`` is floor2 and ``door`` is ``open``; drive out, with ``hold`` again
    release

Doors that nobody holds open close by themselves. They open again when something is between them.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from rackhand.schemas.base import Message, Pose2, Stamp

Door = Literal["closed", "opening", "open", "closing"]
ClientName = Annotated[str, Field(min_length=1, max_length=60)]

HOLD = 10.0
"""Seconds that the doors stay open after they have opened, and after each ``hold``."""
PATIENCE = 60.0
"""Seconds after which a client that asks nothing while the cabin is at rest loses the lift."""


class CallLift(Message):
    """Bring the cabin to this floor and open its doors, now or after the calls before. Asked again, it changes the
    floor of the client's call."""

    op: Literal["call"] = "call"
    client: ClientName
    floor: str


class HoldDoor(Message):
    """Keep the doors open for ``HOLD`` seconds from now on. Refused unless the client has the lift."""

    op: Literal["hold"] = "hold"
    client: ClientName


class GoToFloor(Message):
    """Close the doors, take what is in the cabin to this floor, and open them. Refused unless the client has the
    lift."""

    op: Literal["go"] = "go"
    client: ClientName
    floor: str


class ReleaseLift(Message):
    """Give the lift to the next one, or take back a call that waits. Doors close when their time is over."""

    op: Literal["release"] = "release"
    client: ClientName


class GetLift(Message):
    op: Literal["get"] = "get"


class LiftRequest(Message):
    request: Annotated[CallLift | HoldDoor | GoToFloor | ReleaseLift | GetLift, Field(discriminator="op")]


class LiftState(Message):
    """State of a lift.

    ``floor``: where the cabin is, and where it came from while it is ``moving``. ``target``: the floor that it goes to,
    or is to go to once its doors have closed; None where it stays. ``door``: of the cabin and of the shaft at that
    floor, which move together; all others are closed. ``opening``: 0 closed … 1 open. ``blocked``: something is between
    the doors. ``holder``: the client that has the lift; ``waiting``: those whose calls come next, in this order.
    """

    stamp: Stamp
    floor: str
    target: str | None = None
    moving: bool = False
    door: Door
    opening: Annotated[float, Field(ge=0, le=1)]
    blocked: bool = False
    holder: str | None = None
    waiting: tuple[str, ...] = Field(default=(), strict=False)


class LiftFloor(Message):
    """One floor of a lift. ``pose``: the middle of the cabin in the frame of that floor's map, its x axis pointing out
    of the door; ``map``: name of that map."""

    name: str
    map: str
    pose: Pose2


class LiftModel(Message):
    """What a lift is: its floors, the inside of its cabin along and across the way in, and the width of its door (m).

    ``door_at``: distance of the shaft's door from the middle of the cabin.
    """

    floors: tuple[LiftFloor, ...] = Field(strict=False)
    depth: float
    width: float
    door_width: float
    door_at: float
