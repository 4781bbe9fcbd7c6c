"""The goods-to-arm story as data: what is done, in which order, and what each step waits for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Move:
    """A move of the chassis to a point of the map."""

    kind: str
    point: str


@dataclass(frozen=True)
class Jack:
    direction: str


@dataclass(frozen=True)
class Lock:
    """Take control of the arm, for all picks."""


@dataclass(frozen=True)
class Pick:
    """An item from the shelf to the table. ``interrupted``: a client with a smaller priority takes control once."""

    item: str
    interrupted: bool = False


@dataclass(frozen=True)
class Unlock:
    """Bring the arm back, and give control back."""


@dataclass(frozen=True)
class Charge:
    point: str


Action = Move | Jack | Lock | Pick | Unlock | Charge


@dataclass(frozen=True)
class Step:
    title: str
    action: Action


RACK, STORED_AT, PRESENTED_AT = "rack_s4", "s4", "p3"
CHARGER = "Charging Station"
ITEMS = ("jar_1", "jar_2", "jar_3")

STORY = (
    Step("drive under the rack in storage", Move("align_with_rack", STORED_AT)),
    Step("raise the rack", Jack("up")),
    Step("carry it to the pick station", Move("to_unload_point", PRESENTED_AT)),
    Step("set it down before the arm", Jack("down")),
    Step("take control of the arm", Lock()),
    Step("pick the first jar", Pick("jar_1")),
    Step("pick the second jar, interrupted once by another client", Pick("jar_2", interrupted=True)),
    Step("pick the third jar", Pick("jar_3")),
    Step("give the arm back", Unlock()),
    Step("raise the rack", Jack("up")),
    Step("carry it back to storage", Move("to_unload_point", STORED_AT)),
    Step("set it down", Jack("down")),
    Step("drive to the charger and charge", Charge(CHARGER)),
)
