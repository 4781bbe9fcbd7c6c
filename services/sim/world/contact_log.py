"""The contact log: each time a robot's body begins to touch something that is not its own, by the physics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.schemas.world import Contact

MAX_LISTED = 1000
# A contact that parts for less than this and comes again is the same one: stiff bodies chatter.
PARTING_NS = 100_000_000


@dataclass
class _Touch:
    """One begun contact; ``row`` is its place in the list, if it still found one."""

    last: int
    row: int | None


class ContactLog:
    """``hulls``: geom → robot whose body it is. ``name_of``: geom → name of the thing it belongs to.

    It reads the contacts of *every* physics step, so none is too short for it; that costs some 2 µs, because a chassis'
    body meets nothing, not even the floor, unless it collides (``layers``).
    """

    def __init__(self, hulls: Mapping[int, str], ngeom: int, name_of: Callable[[int], str]) -> None:
        self._hulls = hulls
        self._is_hull = np.zeros(ngeom, dtype=bool)
        self._is_hull[list(hulls)] = True
        self._name_of = name_of
        self._open: dict[tuple[str, str], _Touch] = {}
        self._rows: list[Contact] = []
        self._force = np.empty(6)
        self.count = 0
        _any_of(
            self._is_hull, np.empty((0, 2), np.int32)
        )  # compiled here, so that the first contact does not wait for it

    @property
    def rows(self) -> tuple[Contact, ...]:
        return tuple(self._rows)

    def touches(self, data: Any) -> bool:
        """Whether a body touches anything now."""
        return data.ncon > 0 and bool(_any_of(self._is_hull, data.contact.geom))

    def observe(self, model: Any, data: Any, stamp: int) -> list[tuple[str, int]]:
        """Take in the contacts of one step. Returns (robot, index of the contact) of those that hold now."""
        touched = self._is_hull[data.contact.geom]
        held = []
        for index, side in zip(*np.nonzero(touched), strict=True):
            pair = data.contact.geom[index]
            robot = self._hulls[int(pair[side])]
            mujoco.mj_contactForce(model, data, int(index), self._force)
            self._touch(robot, self._name_of(int(pair[1 - side])), stamp, float(self._force[0]))
            held.append((robot, int(index)))
        return held

    def _touch(self, robot: str, other: str, stamp: int, force: float) -> None:
        touch = self._open.get((robot, other))
        if touch is None or stamp - touch.last > PARTING_NS:
            self.count += 1
            touch = _Touch(stamp, len(self._rows) if len(self._rows) < MAX_LISTED else None)
            self._open[(robot, other)] = touch
            if touch.row is not None:
                self._rows.append(Contact(stamp=stamp, robot=robot, other=other, force=force))
        touch.last = stamp
        if touch.row is not None and force > self._rows[touch.row].force:
            self._rows[touch.row] = self._rows[touch.row].model_copy(update={"force": force})


@compiled
def _any_of(is_hull: NDArray[np.bool_], geoms: NDArray[np.int32]) -> bool:
    """Whether one of ``geoms`` (contacts × 2) is a hull; -1 stands for no geom."""
    for i in range(len(geoms)):
        if (geoms[i, 0] >= 0 and is_hull[geoms[i, 0]]) or (geoms[i, 1] >= 0 and is_hull[geoms[i, 1]]):
            return True
    return False
