"""Which parts of the world touched which, and when: so that a test can say what contact is allowed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.schemas.world import Touch

Stamps = NDArray[np.int64]
NEVER = -1


class TouchLog:
    """``labels``: for each geom the name of the part of the world that it belongs to. Geoms of one name are one part,
    whose contacts with itself are left out.

    It reads the contacts of every physics step; things that sleep have none.
    """

    def __init__(self, labels: Iterable[str]) -> None:
        self._names: list[str] = []
        self._part = np.array([self._index(label) for label in labels], np.intp)
        self._first: Stamps = np.full((0, 0), NEVER, np.int64)
        self._last = self._first
        self._grow()
        # Compiled here, so that the first contact does not wait for it.
        _mark(self._first, self._last, self._part, np.empty((0, 2), np.int32), 0)

    def relabel(self, geom: int, label: str) -> None:
        """The geom belongs to another part from now on."""
        self._part[geom] = self._index(label)
        self._grow()

    def observe(self, data: Any, stamp: int) -> None:
        """Take in the contacts of the step that begins at ``stamp``."""
        if data.ncon:
            _mark(self._first, self._last, self._part, data.contact.geom, stamp)

    @property
    def rows(self) -> tuple[Touch, ...]:
        """Each pair of parts that touched, by their names."""
        found = [(*sorted((self._names[i], self._names[j])), i, j) for i, j in np.argwhere(self._first >= 0)]
        return tuple(
            Touch(parts=(a, b), first=int(self._first[i, j]), last=int(self._last[i, j]))
            for a, b, i, j in sorted(found)
        )

    def _index(self, label: str) -> int:
        if label not in self._names:
            self._names.append(label)
        return self._names.index(label)

    def _grow(self) -> None:
        size, before = len(self._names), len(self._first)
        if size == before:
            return
        first, last = np.full((size, size), NEVER, np.int64), np.full((size, size), NEVER, np.int64)
        first[:before, :before], last[:before, :before] = self._first, self._last
        self._first, self._last = first, last


@compiled
def _mark(first: Stamps, last: Stamps, part: NDArray[np.intp], geoms: NDArray[np.int32], stamp: int) -> None:
    """``geoms``: contacts × 2; -1 is no geom."""
    for k in range(len(geoms)):
        if geoms[k, 0] < 0 or geoms[k, 1] < 0:
            continue
        a, b = part[geoms[k, 0]], part[geoms[k, 1]]
        if a == b:
            continue
        i, j = min(a, b), max(a, b)
        if first[i, j] < 0:
            first[i, j] = stamp
        last[i, j] = stamp
