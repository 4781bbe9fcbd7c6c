"""Racks: the kinds that a chassis may carry, what is detected of one, and which rack points are occupied."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, Strict

from rackhand.schemas.base import Array, Message, Pose2, Stamp

Positive = Annotated[float, Field(gt=0, le=10)]
NonNegative = Annotated[float, Field(ge=0, le=2)]
Margin = Annotated[tuple[NonNegative, NonNegative, NonNegative, NonNegative], Strict(False)]
Occupancy = Literal["unknown", "occupied", "free"]
LoadState = Literal["free", "under_rack", "carrying", "docked"]


class RackSpec(Message):
    """A kind of rack, as in the setting ``rack.specs``. Metres.

    The frame of a rack has its origin on the floor in the middle between the legs and x along the heading of the
    chassis that is under it. ``depth`` is measured over the outer faces of the legs along x, ``width`` along y.
    ``margin``: parts that stick out beyond the legs in front, behind, to the left and to the right.
    ``alignment``: the chassis' origin under the rack's middle, or its front edge ``alignment_margin_back`` before the
    far edge of the rack. ``extra_leg_offset``: plates that stand inward from the legs, out of the lidar's plane.
    ``foot_radius``: of castors under the legs. ``cargo_to_jack_front_edge_min_distance`` is kept for clients and has no
    effect.
    """

    width: Positive
    depth: Positive
    margin: Margin = (0.05, 0.05, 0.05, 0.05)
    alignment: Literal["center", "back"] = "center"
    alignment_margin_back: NonNegative = 0.02
    extra_leg_offset: NonNegative = 0.02
    leg_shape: Literal["square", "round", "other"] = "square"
    leg_size: Positive = 0.03
    foot_radius: NonNegative = 0.05
    cargo_to_jack_front_edge_min_distance: NonNegative = 0.05

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
