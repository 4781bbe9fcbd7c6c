"""Whether a planned curve keeps the arm clear of itself and of its station."""

from __future__ import annotations

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller import ik
from rackhand.services.controller.ik.clearance import STEP
from rackhand.services.controller.trajectory.curve import JointCurve

_PIECES = 8  # of each piece of a curve, to see how far it moves the arm


class PathClearance:
    """``PathCheck`` of one arm, for one thread."""

    def __init__(self, arm: ik.Arm) -> None:
        self._clearance = ik.Clearance(arm)

    def conflict(self, curve: JointCurve, start: float) -> tuple[float, str] | None:
        """Where from ``start`` on the ``curve`` comes too near something, and what."""
        s = self._places(curve, start)
        found = self._clearance.first_conflict(curve.derivatives(s)[0])
        return None if found is None else (float(s[found.number]), str(found))

    def _places(self, curve: JointCurve, start: float) -> Array:
        """Values of s so near each other that no point of the arm moves farther than ``STEP`` between them."""
        knots = np.unique(np.concatenate([[start], curve.s[curve.s > start]]))
        s = _divided(knots, np.full(knots.size - 1, _PIECES))
        travel = np.diff(self._clearance.travel(curve.derivatives(s)[0]))
        return _divided(s, np.maximum(np.ceil(travel / STEP), 1).astype(int))


def _divided(s: Array, pieces: np.ndarray[tuple[int], np.dtype[np.int_]]) -> Array:
    """``s`` (k,), with the interval after s[i] in ``pieces``[i] equal ones."""
    first = np.repeat(s[:-1], pieces)
    step = np.repeat(np.diff(s) / pieces, pieces)
    number = np.arange(first.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.append(first + number * step, s[-1])
