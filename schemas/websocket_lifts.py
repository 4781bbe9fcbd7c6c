"""WebSocket topics about lifts, which the chassis API does not have."""

from __future__ import annotations

from rackhand.schemas.lift import Door
from rackhand.schemas.websocket import Frame, WsTopic


class LiftRow(Frame):
    """A lift: `floor` is where the cabin is, or came from while it is `moving`; `opening` is 0 closed to 1 open;
    `holder` is the client that has the lift, `waiting` those whose calls come next."""

    name: str
    floor: str
    target: str | None
    moving: bool
    door: Door
    opening: float
    blocked: bool
    holder: str | None
    waiting: list[str]


class LiftStates(WsTopic):
    """floor, doors and holder of every lift of the cell (an extension)"""

    TOPIC = "/lift_states"
    RATE = 5.0

    lifts: list[LiftRow]
