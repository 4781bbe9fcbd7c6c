"""Racks: the kinds that a chassis may carry, what is detected of one, and which rack points are occupied."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from rackhand.schemas.base import Array, Message, Pose2, Stamp

Positive = Annotated[float, Field(gt=0, le=10)]
NonNegative = Annotated[float, Field(ge=0, le=2)]
Margin = Annotated[tuple[NonNegative, NonNegative, NonNegative, NonNegative], Strict(False)]
Occupancy = Literal["unknown", "occupied", "free"]
LoadState = Literal["free", "under_rack", "carrying", "docked"]


class RackSpec(Message):
    """A kind of rack, as in the setting ``rack.specs``. Metres.

    The frame of a rack has its origin on the floor in the middle between the legs and x along the heading of the
    chassis that is under it.
    """

    width: Positive = Field(description="over the outer faces of the legs, across the heading of a robot under it")
    depth: Positive = Field(description="over the outer faces of the legs, along that heading")
    margin: Margin = Field(
        (0.05, 0.05, 0.05, 0.05),
        description="parts that stick out beyond the legs in front, behind, to the left and to the right",
    )
    alignment: Literal["center", "back"] = Field(
        "center",
        description="`center`: the robot's origin under the rack's middle; `back`: its front edge "
        "`alignment_margin_back` before the far edge of the rack",
    )
    alignment_margin_back: NonNegative = Field(0.02, description="see `alignment`")
    extra_leg_offset: NonNegative = Field(
        0.02, description="plates that stand inward from the legs, where the lidar does not see them"
    )
    leg_shape: Literal["square", "round", "other"] = Field("square", description="`square`, `round` or `other`")
    leg_size: Positive = Field(0.03, description="side or diameter of a leg")
    foot_radius: NonNegative = Field(0.05, description="of castors under the legs")
    cargo_to_jack_front_edge_min_distance: NonNegative = Field(0.05, description="no effect: kept and returned")

    @model_validator(mode="after")
    def _legs_apart(self) -> Self:
        for name, length in (("width", self.width), ("depth", self.depth)):
            if length <= 2 * self.leg_size:
                raise ValueError(f"{name} {length:g} is not more than two legs of leg_size {self.leg_size:g}")
        return self

    def outline(self) -> np.ndarray:
        """The rack with its margins in its own frame: corners (4, 2), counter-clockwise."""
        front, back, left, right = self.margin
        x, y = self.depth / 2, self.width / 2
        return np.array(
            [(x + front, y + left), (-x - back, y + left), (-x - back, -y - right), (x + front, -y - right)]
        )


class LoadReport(Message):
    """What a chassis carries or is connected to, as its planner knows it.

    ``state``: nothing; under a rack that is on the floor; carrying a rack; on the contacts of a charger. ``spec`` and
    ``rack_pose`` are those of the rack, None without one; the pose is in the chassis frame while the rack is carried,
    in the map frame while it is on the floor.
    """

    stamp: Stamp
    state: LoadState = "free"
    spec: RackSpec | None = None
    rack_pose: Pose2 | None = None


class DetectedRack(Message):
    """One search for a rack in a scan; the source of ``/detected_rack``.

    ``pose``: of the rack's frame in the map, None where none was found; ``width`` and ``depth`` as measured. ``legs``:
    rows x, y of the legs' middles in the map. ``staging``: where the chassis begins to drive under it.
    """

    stamp: Stamp
    detected: bool
    pose: Pose2 | None = None
    width: float = 0.0
    depth: float = 0.0
    legs: Annotated[np.ndarray, Array("<f8", (-1, 2))] = Field(default_factory=lambda: np.empty((0, 2)))
    staging: Pose2 | None = None


class SeenRack(Message):
    """A rack that scans have shown: on the floor, or above the chassis. ``stamp``: when it was seen last; ``pose``: of
    its frame in the map."""

    stamp: Stamp
    pose: Pose2
    spec: RackSpec


class SeenRacks(Message):
    """All racks that scans have shown and that are believed to be there still, without one that is carried."""

    stamp: Stamp
    racks: Annotated[tuple[SeenRack, ...], Strict(False)] = ()


class RackLevel(Message):
    """What is known of one level of a rack point. ``stamp``: when it was seen last."""

    stamp: Stamp
    level: int = 0
    state: Occupancy = "unknown"


class RackPoint(Message):
    """A rack point of the map, by the id of its overlay feature."""

    poi_id: str
    levels: tuple[RackLevel, ...] = Field(strict=False)


class RackStates(Message):
    """Which rack points of a map are occupied."""

    stamp: Stamp
    map_uid: str
    racks: tuple[RackPoint, ...] = Field(default=(), strict=False)
