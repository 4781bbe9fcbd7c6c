"""What a drive reports as its effort: the mean of its motor's torque since the state before.

A sample of the torque says little where a command came late: the torque of its correction swings within a period.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LONGEST = 100  # control steps over which a mean may go


class Efforts:
    """Of an arm with ``n`` joints, N·m, with so many physics ``steps`` in a control step."""

    def __init__(self, n: int, steps: int) -> None:
        self.total = np.zeros(n)  # of the physics steps since the control step began; servos add to it
        self.period = 1  # control steps between two states
        self._steps = steps
        self._before: deque[Array] | None = None  # totals of the control steps before; None: time has not begun

    def begin(self) -> None:
        """A control step begins."""
        if self._before is None:
            self._before = deque(maxlen=LONGEST)
        else:
            self._before.append(self.total.copy())
        self.total[:] = 0.0

    def mean(self, torque: Array) -> Array:
        """At the end of a control step. ``torque`` (n,) is what it is before the first of them."""
        if self._before is None:
            return torque
        totals = [*self._before, self.total][-self.period :]
        return np.asarray(np.sum(totals, axis=0) / (self._steps * len(totals)))
