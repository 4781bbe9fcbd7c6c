"""The frames of the WebSocket topics about lifts."""

from __future__ import annotations

from rackhand.schemas.websocket_lifts import LiftRow, LiftStates
from rackhand.services.gateway.ws.facts import Facts
from rackhand.services.gateway.ws.payloads import payload


@payload(LiftStates)
def lift_states(facts: Facts) -> LiftStates | None:
    if not facts.lifts:
        return None
    rows = [
        LiftRow(
            name=name,
            floor=state.floor,
            target=state.target,
            moving=state.moving,
            door=state.door,
            opening=round(state.opening, 3),
            blocked=state.blocked,
            holder=state.holder,
            waiting=list(state.waiting),
        )
        for name, state in sorted(facts.lifts.items())
    ]
    return LiftStates(lifts=rows)
