"""Convex polygons in the plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def inside_convex(polygon: Array, points: Array) -> NDArray[np.bool_]:
    """Which points, (n, 2), are inside or on the boundary of a convex polygon, (k, 2) in either winding; (n,) bools."""
    sides = np.roll(polygon, -1, axis=0) - polygon
    to_point = points[:, None, :] - polygon[None, :, :]
    cross = sides[None, :, 0] * to_point[:, :, 1] - sides[None, :, 1] * to_point[:, :, 0]
    inside: NDArray[np.bool_] = np.logical_or((cross >= 0.0).all(axis=1), (cross <= 0.0).all(axis=1))
    return inside


def convex_overlap(a: Array, b: Array) -> bool:
    """Whether two convex polygons, (n, 2) and (m, 2), overlap: no side of either separates them."""
    for polygon in (a, b):
        sides = np.roll(polygon, -1, axis=0) - polygon
        for normal in np.column_stack([sides[:, 1], -sides[:, 0]]):
            pa, pb = a @ normal, b @ normal
            if pa.max() < pb.min() or pb.max() < pa.min():
                return False
    return True
