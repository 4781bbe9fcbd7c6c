"""Faults that the simulator can cause on request: one row a fault."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

Target = Literal["chassis", "rack", "lift"]


@dataclass(frozen=True)
class FaultKind:
    """``target``: what kind of thing has it. ``parts``: how many parts one of them can have it at, 0 for the whole."""

    name: str
    target: Target
    text: str
    parts: int = 0


FAULTS = {
    kind.name: kind
    for kind in (
        FaultKind("lidar_dead", "chassis", "no scans"),
        FaultKind("lidar_blind", "chassis", "scans without a measurement"),
        FaultKind("wheels_blocked", "chassis", "the drive turns no wheel"),
        FaultKind("power_cable", "chassis", "a charging cable is plugged in"),
        FaultKind("emergency_stop_button", "chassis", "the emergency stop button is pressed"),
        FaultKind("pose_lost", "chassis", "no localised pose"),
        FaultKind("no_charge_contact", "chassis", "its charging contacts never meet those of a charger"),
        FaultKind("no_charge_current", "chassis", "its charging contacts meet, and no current flows"),
        FaultKind("leg_hidden", "rack", "the lidar does not see a leg of the rack, or (without a part) any", parts=4),
        FaultKind("lift_door_closes", "lift", "the doors close, also on what is between them, and stay closed"),
        FaultKind("lift_occupied", "lift", "a person stands in the cabin"),
        FaultKind("lift_taken", "lift", "someone else has the lift and does not give it back"),
    )
}


def _known(name: str) -> str:
    if name not in FAULTS:
        raise ValueError(f"fault {name!r} is not known; known: {sorted(FAULTS)}")
    return name


FaultName = Annotated[str, AfterValidator(_known), Field(json_schema_extra={"enum": list(FAULTS)})]
