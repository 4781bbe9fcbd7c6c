"""Shapes of the static objects of a world, as plain values; the physics and the map are both made of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from rackhand.schemas.planar import transform
from rackhand.worlds.world_model import Box, Charger, Cylinder, StaticThing, Wall


@dataclass(frozen=True)
class Shape:
    """An upright box (half-lengths a, b, c) or cylinder (radius a, half-height c); x, y, z is its middle."""

    kind: Literal["box", "cylinder"]
    x: float
    y: float
    z: float
    yaw: float
    a: float
    b: float
    c: float
    colour: tuple[float, float, float]

    @property
    def half_sizes(self) -> list[float]:
        """As MuJoCo wants them."""
        return [self.a, self.b, self.c] if self.kind == "box" else [self.a, self.c, 0.0]

    def cuts(self, height: float) -> bool:
        """Whether the horizontal plane at ``height`` goes through it."""
        return self.z - self.c < height < self.z + self.c


def static_shapes(static: StaticThing) -> tuple[Shape, ...]:
    match static:
        case Wall():
            return (_wall(static),)
        case Box():
            x, y, yaw = static.pose
            length, width, height = static.size
            return (Shape("box", x, y, static.z + height / 2, yaw, length / 2, width / 2, height / 2, static.colour),)
        case Cylinder():
            (x, y), half = static.centre, static.height / 2
            return (Shape("cylinder", x, y, half, 0.0, static.radius, static.radius, half, static.colour),)


def _wall(wall: Wall) -> Shape:
    (x0, y0), (x1, y1) = wall.start, wall.end
    length, yaw = math.hypot(x1 - x0, y1 - y0), math.atan2(y1 - y0, x1 - x0)
    half_height = wall.height / 2
    return Shape(
        "box",
        (x0 + x1) / 2,
        (y0 + y1) / 2,
        half_height,
        yaw,
        length / 2,
        wall.thickness / 2,
        half_height,
        wall.colour,
    )


# The dock's face is a notch of two plates, each turned by this from the dock's back, which makes it visible to a lidar.
CHARGER_V_ANGLE = math.radians(25)
_CHARGER_PLATE = (0.26, 0.03, 0.5)  # length, thickness, height
_CHARGER_BACK = (0.04, 0.5, 0.5)
_CHARGER_COLOUR = (0.2, 0.6, 0.3)


def charger_shapes(charger: Charger) -> tuple[Shape, ...]:
    """The back plate, whose middle is the charger's pose, and the two plates of the notch before it."""
    length, thickness, height = _CHARGER_PLATE
    z = height / 2
    x, y, yaw = charger.pose
    depth, width, back_height = _CHARGER_BACK
    shapes = [Shape("box", x, y, back_height / 2, yaw, depth / 2, width / 2, back_height / 2, _CHARGER_COLOUR)]
    for side in (1, -1):
        turned = side * (math.pi / 2 - CHARGER_V_ANGLE)
        px, py = transform(charger.pose, depth / 2 + length / 2 * math.cos(turned), length / 2 * math.sin(turned))
        shapes.append(Shape("box", px, py, z, yaw + turned, length / 2, thickness / 2, z, _CHARGER_COLOUR))
    return tuple(shapes)
