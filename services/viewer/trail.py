"""Where something has been: points no closer than a step, the newest so many of them."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import Vec3


class Trail:
    def __init__(self, step: float, longest: int) -> None:
        self._step = step
        self._points: deque[Vec3] = deque(maxlen=longest)

    def __len__(self) -> int:
        return len(self._points)

    @property
    def points(self) -> NDArray[np.float64]:
        """(n, 3)"""
        return np.array(self._points, dtype=np.float64).reshape(-1, 3)

    def add(self, point: Vec3) -> bool:
        """True if it was far enough from the last one to be kept."""
        if self._points and math.dist(self._points[-1], point) < self._step:
            return False
        self._points.append(point)
        return True
