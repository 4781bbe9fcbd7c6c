"""Faults that the simulator can cause on request: one row a fault."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

Target = Literal["chassis", "rack", "lift", "charger", "thing", "obstacle"]
"""What has a fault: ``thing`` is anything that is seen, as a wall, a rack or an obstacle; an ``obstacle`` is a new one,
under the name that is given."""


@dataclass(frozen=True)
class Amount:
    """How much of a fault: its default, the smallest and the greatest, and what it is."""

    default: float
    least: float
    most: float
    text: str


@dataclass(frozen=True)
class FaultKind:
    """``target``: what kind of thing has it. ``parts``: how many parts one of them can have it at, 0 for the whole.

    ``amount``: of a fault that can be more or less. ``pose``: of one that needs a pose in the map (``at``), or a shift
    in the frame of what has it.
    """

    name: str
    target: Target
    text: str
    parts: int = 0
    amount: Amount | None = None
    pose: Literal["at", "shift"] | None = None

    @property
    def options(self) -> tuple[str, ...]:
        """What it takes beside its target, as on the command line."""
        found = [f"--part 0 … {self.parts - 1}"] if self.parts else []
        if (amount := self.amount) is not None:
            limits = f"{amount.least:g} … {amount.most:g}"
            found.append(f"--amount {limits} ({amount.text}; default {amount.default:g})")
        return (*found, *((f"--{self.pose} X Y YAW",) if self.pose else ()))


FAULTS = {
    kind.name: kind
    for kind in (
        FaultKind("lidar_dead", "chassis", "no scans"),
        FaultKind("lidar_blind", "chassis", "scans without a measurement"),
        FaultKind(
            "lidar_noisy",
            "chassis",
            "scans with more noise",
            amount=Amount(0.1, 0.0, 5.0, "standard deviation of a range in m, beside that of the lidar"),
        ),
        FaultKind("wheels_blocked", "chassis", "the drive turns no wheel"),
        FaultKind(
            "wheel_slip",
            "chassis",
            "the wheels slip on the floor, as on oil",
            amount=Amount(0.02, 0.001, 1.0, "coefficient of friction"),
        ),
        FaultKind(
            "tilted",
            "chassis",
            "the IMU measures that the chassis is tilted to its left side",
            amount=Amount(0.2, -1.5, 1.5, "rad"),
        ),
        FaultKind("power_cable", "chassis", "a charging cable is plugged in"),
        FaultKind("emergency_stop_button", "chassis", "the emergency stop button is pressed"),
        FaultKind(
            "driver_gone",
            "chassis",
            "its driver disconnects: it measures nothing, takes no commands, and the chassis brakes",
        ),
        FaultKind("pose_lost", "chassis", "no localised pose"),
        FaultKind("kidnapped", "chassis", "set down elsewhere, which odometry does not measure", pose="at"),
        FaultKind(
            "battery_critical",
            "chassis",
            "the battery is nearly empty",
            amount=Amount(0.05, 0.0, 1.0, "charge, 1 is full"),
        ),
        FaultKind("no_charge_contact", "chassis", "its charging contacts never meet those of a charger"),
        FaultKind("no_charge_current", "chassis", "its charging contacts meet, and no current flows"),
        FaultKind("leg_hidden", "rack", "the lidar does not see a leg of the rack, or (without a part) any", parts=4),
        FaultKind("rack_missing", "rack", "the rack is taken away"),
        FaultKind("rack_slid", "rack", "the rack slides, also on the jack that carries it", pose="shift"),
        FaultKind(
            "rack_resized",
            "rack",
            "the legs of the rack are nearer to its middle",
            amount=Amount(0.85, 0.5, 1.0, "times its length and width"),
        ),
        FaultKind("dock_moved", "charger", "the charger is elsewhere than the map shows", pose="shift"),
        FaultKind("glass", "thing", "the lidar does not see it, but it can be touched"),
        FaultKind("corridor_blocked", "obstacle", "a crate of 0.8 m", pose="at"),
        FaultKind("person_standing", "obstacle", "a person who stands there", pose="at"),
        FaultKind("lift_door_closes", "lift", "the doors close, also on what is between them, and stay closed"),
        FaultKind("lift_occupied", "lift", "a person stands in the cabin"),
        FaultKind("lift_taken", "lift", "someone else has the lift and does not give it back"),
    )
}


def amount_of(kind: FaultKind, amount: float | None) -> float:
    """The amount that is meant. Raises ``ValueError`` for one that the fault does not have or cannot have."""
    if kind.amount is None:
        if amount is not None:
            raise ValueError(f"fault {kind.name!r} has no amount")
        return 1.0
    value = kind.amount.default if amount is None else amount
    if not kind.amount.least <= value <= kind.amount.most:
        allowed = f"{kind.amount.least:g} … {kind.amount.most:g}"
        raise ValueError(f"amount {value:g} of fault {kind.name!r}: want {allowed} ({kind.amount.text})")
    return value


def _known(name: str) -> str:
    if name not in FAULTS:
        raise ValueError(f"fault {name!r} is not known; known: {sorted(FAULTS)}")
    return name


FaultName = Annotated[str, AfterValidator(_known), Field(json_schema_extra={"enum": list(FAULTS)})]
