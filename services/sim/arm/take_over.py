"""Positions that follow a torque: taken over from where the arm is, with the velocity that it has.

While the first of them was on its way the torque still acted, so that the arm is ahead of them and faster. Both
differences are faded out by a cubic (Hermite) with level end, instead of being taken out at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TIME = 0.3  # s in which the differences fade
FARTHEST = 0.1  # rad; a joint that is farther off is commanded to go elsewhere


class TakeOver:
    """Arrays are (n,), one entry a joint: rad, rad/s. ``acceleration``: its limits (rad/s²), which the fading keeps."""

    def __init__(self, acceleration: Array) -> None:
        self._fastest = acceleration * TIME / 4  # the fading of a velocity begins with 4 times it over the time
        self._ahead = self._faster = self._velocity = np.zeros(len(acceleration))
        self._taken = np.zeros(len(acceleration), np.bool_)
        self._first: Array | None = None
        self._since = 0

    def begin(self, stamp: int, values: Array, position: Array, velocity: Array) -> None:
        """``values`` are the first positions, of ``stamp``; the arm will be at ``position``, with ``velocity``, when
        they take effect."""
        self._since, self._first, self._velocity = stamp, values, velocity
        self._taken = np.abs(position - values) <= FARTHEST
        self._ahead = np.where(self._taken, position - values, 0.0)
        self._faster = np.zeros(len(values))

    def added(self, stamp: int, values: Array) -> Array:
        """What to add to the positions ``values`` of ``stamp``. How fast they go only the second ones tell."""
        time = (stamp - self._since) * 1e-9
        if self._first is not None and time > 0:
            faster = self._velocity - (values - self._first) / time
            self._faster = np.where(self._taken, np.clip(faster, -self._fastest, self._fastest), 0.0)
            self._first = None
        share = min(max(time / TIME, 0.0), 1.0)
        return np.asarray((1.0 - share) ** 2 * ((1.0 + 2.0 * share) * self._ahead + share * TIME * self._faster))
