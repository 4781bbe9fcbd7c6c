"""Poses of the tool for a pick from a shelf between two boards and a place on the table; no I/O.

Map frame in metres and radians. The cup points down throughout; the rim of the cup is ``CUP`` below the flange.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rackhand.schemas import planar

Json = dict[str, Any]
Point = tuple[float, float, float]

CUP = 0.12  # m, from the flange to the rim of the suction cup
PRESS = 0.0005  # m that the cup is pressed onto a lid
LIFT = 0.08  # m above a lid at which the tool enters and leaves the shelf: the board above leaves 0.39 m
OUTSIDE = 0.6  # m from the middle of the rack to where the tool waits in front of its shelf
OVER_TABLE = 0.16  # m between a carried item and the table: over what lies there already
SET_DOWN = 0.005  # m above the table at which an item is released
ACROSS = math.pi / 2  # heading of the cup in front of the shelf
ALONG = 0.0  # over the table
# Joints 2 to 5 (rad) of a posture in which the arm and what it carries turn clear of rack and table.
TUCKED = (-1.93, 1.63, -1.28, -1.57)
TO_SHELF, TO_TABLE = -2.82, 0.0  # joint 1


@dataclass(frozen=True)
class Base:
    """Where the arm's base is: pose in the map, and height above the floor (m)."""

    pose: planar.PoseLike
    height: float

    def tool(self, point: Point, heading: float) -> Json:
        """A CRF task pose that puts the rim of the cup at a point of the map, pointing down, turned by ``heading``."""
        x, y, _ = planar.between(self.pose, (point[0], point[1], 0.0))
        turned = heading - self.pose[2]
        c, s = math.cos(turned), math.sin(turned)
        return {
            "Position": [x, y, point[2] + CUP - self.height],
            "Orientation": {"Matrix": {"Row1": [c, s, 0.0], "Row2": [s, -c, 0.0], "Row3": [0.0, 0.0, -1.0]}},
        }


@dataclass(frozen=True)
class Goods:
    """An item on the shelf of a rack, as an inventory has it.

    ``at``: the middle of its lid in the frame of the rack (m). ``height``: its own. ``target``: where on the table it
    is to stand; ``table``: height of that.
    """

    name: str
    at: Point
    height: float
    target: tuple[float, float]
    table: float

    def lid(self, rack: planar.PoseLike) -> Point:
        """The middle of its lid in the map, with the rack where it is seen."""
        x, y, _ = planar.compose(rack, (self.at[0], self.at[1], 0.0))
        return x, y, self.at[2]

    def pressed(self, rack: planar.PoseLike) -> Point:
        """Where the rim of the cup seals."""
        x, y, z = self.lid(rack)
        return x, y, z - PRESS

    def above_lid(self, rack: planar.PoseLike) -> Point:
        x, y, z = self.lid(rack)
        return x, y, z + LIFT

    def before_shelf(self, rack: planar.PoseLike) -> Point:
        """In front of the shelf on the side of the item, at the height at which the tool goes in."""
        across = math.copysign(OUTSIDE, self.at[1])
        x, y, _ = planar.compose(rack, (self.at[0], across, 0.0))
        return x, y, self.at[2] + LIFT

    def over_target(self, above: float) -> Point:
        """The rim of the cup with the item ``above`` metres over the table."""
        return (*self.target, self.table + self.height + above)
