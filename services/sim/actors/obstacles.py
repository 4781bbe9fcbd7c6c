"""What is placed, moved and removed while the world runs: slots compiled into the model, parked under the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rackhand.schemas.planar import yaw_quaternion
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.sim.actors.walkers import Walker
from rackhand.services.sim.errors import unknown
from rackhand.services.sim.mjcf.layers import PARKED_GROUP, VISIBLE_GROUP
from rackhand.services.sim.mjcf.scene import PARKED_Z, SLOTS, slot_name
from rackhand.worlds.data import PoseTuple

PERSON_SIZE = (0.25, 1.75)
_PARTS = {"box": "l, w, h", "cylinder": "radius, height", "person": "radius, height"}


@dataclass(frozen=True)
class Placed:
    """A thing in a slot. Sizes in metres: box l×w×h, cylinder and person r×h."""

    kind: str
    slot: int
    size: tuple[float, ...]
    pose: PoseTuple
    walker: Walker | None = None

    @property
    def radius(self) -> float:
        """Of the circle about its middle that it fills, seen from above."""
        return math.hypot(self.size[0], self.size[1]) / 2 if self.kind == "box" else self.size[0]


class Obstacles:
    """The things placed in one model and data. Changing a slot changes the model: sizes and who sees it."""

    def __init__(self, model: Any, data: Any) -> None:
        self._model, self._data = model, data
        self.placed: dict[str, Placed] = {}
        self._free = {kind: list(range(count)) for kind, count in SLOTS.items()}

    def place(self, name: str, kind: str, size: tuple[float, ...], pose: PoseTuple, walker: Walker | None) -> Placed:
        """Put a thing into the world, or change the one of that name. Raises ``RequestRefused``."""
        check_size(kind, size)
        former = self.placed.get(name)
        free = self._free[kind]
        if former is not None and former.kind == kind:
            slot = former.slot
        elif free:
            slot = free.pop(0)
        else:
            raise RequestRefused(
                RefusalCode.PRECONDITION,
                f"all {SLOTS[kind]} slots for obstacles of kind {kind} are in use; remove one first",
            )
        if former is not None and former.kind != kind:
            self._park(former)
        placed = Placed(kind, slot, size, pose, walker)
        self.placed[name] = placed
        self._resize(placed)
        self.move(placed, pose)
        return placed

    def remove(self, name: str) -> None:
        if name not in self.placed:
            raise unknown("placed thing", name, self.placed)
        self._park(self.placed.pop(name))

    def move(self, placed: Placed, pose: PoseTuple) -> None:
        mocap = self._model.body_mocapid[self.body_of(placed)]
        x, y, yaw = pose
        self._data.mocap_pos[mocap] = (x, y, _height(placed) / 2)
        self._data.mocap_quat[mocap] = yaw_quaternion(yaw)

    def geom_of(self, placed: Placed) -> int:
        return int(self._model.geom(slot_name(placed.kind, placed.slot)).id)

    def body_of(self, placed: Placed) -> int:
        return int(self._model.body(slot_name(placed.kind, placed.slot)).id)

    def names_by_geom(self) -> dict[int, str]:
        return {self.geom_of(placed): name for name, placed in self.placed.items()}

    def _park(self, placed: Placed) -> None:
        geom = self.geom_of(placed)
        self._model.geom_group[geom] = PARKED_GROUP
        self._data.mocap_pos[self._model.body_mocapid[self.body_of(placed)]] = (2.0 * placed.slot, 0.0, PARKED_Z)
        self._free[placed.kind] = sorted([*self._free[placed.kind], placed.slot])

    def _resize(self, placed: Placed) -> None:
        """Set all that follows from a geom's size: also its bounding sphere and boxes, on which culling relies."""
        model, geom = self._model, self.geom_of(placed)
        a, b, height = placed.size[0], placed.size[1], _height(placed)
        if placed.kind == "box":
            sizes, half = (a / 2, b / 2, height / 2), np.array([a, b, height]) / 2
            bound = float(np.linalg.norm(half))
        else:
            straight = height / 2 - (a if placed.kind == "person" else 0.0)
            sizes, half = (a, straight, 0.0), np.array([a, a, height / 2])
            bound = height / 2 if placed.kind == "person" else math.hypot(a, height / 2)
        model.geom_size[geom] = sizes
        model.geom_rbound[geom] = bound
        model.geom_aabb[geom] = [0, 0, 0, *half]
        model.bvh_aabb[model.body_bvhadr[self.body_of(placed)]] = [0, 0, 0, *half]
        model.geom_group[geom] = VISIBLE_GROUP


def _height(placed: Placed) -> float:
    return placed.size[2] if placed.kind == "box" else placed.size[1]


def check_size(kind: str, size: tuple[float, ...]) -> None:
    """Raises ``RequestRefused`` unless the sizes are those of the kind."""
    parts = _PARTS[kind]
    wanted = parts.count(",") + 1
    if len(size) != wanted or not all(0.01 <= s <= 20 for s in size):
        raise RequestRefused(RefusalCode.INVALID, f"size {list(size)} of a {kind}: want {parts}, each 0.01 … 20 m")
    if kind == "person" and size[1] < 2 * size[0] + 0.01:
        raise RequestRefused(RefusalCode.INVALID, f"a person of radius {size[0]} m must be higher than {2 * size[0]} m")
