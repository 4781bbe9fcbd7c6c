"""A scan in clusters: small groups of neighbouring hits with nothing around them, as legs and posts are seen."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.services.planner.geometry.se2 import wrap

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

GAP = 0.08  # m between neighbouring hits of one cluster
LARGEST = 0.12  # m across the line of sight, and along it
FEWEST, NEAR = 2, 1.5  # hits that a cluster nearer than so many metres must have


class Clusters(NamedTuple):
    """Small clusters of a scan, about the lidar.

    ``middles``: means of the hits (n, 2) in the frame of the scan's points. ``bearings``: midway between the outermost
    hits, in radians. ``ranges``: means in metres. ``counts``: numbers of hits. ``steps``: radians between neighbouring
    hits, 0 for a single one.
    """

    middles: Array
    bearings: Array
    ranges: Array
    counts: Array
    steps: Array

    @property
    def number(self) -> int:
        return len(self.middles)

    def at(self, indices: Indices) -> Clusters:
        """Some of them."""
        return Clusters(*(values[indices] for values in self))


def small_clusters(points: Array, sensor: Array) -> Clusters:
    """Clusters no larger than a leg. ``points``: (n, 2) in the order of the beams, which go round; ``sensor``: the
    lidar's position (x, y first) in the same frame."""
    rows = _small_clusters(np.ascontiguousarray(points), float(sensor[0]), float(sensor[1]))
    return Clusters(rows[:, :2], rows[:, 2], rows[:, 3], rows[:, 4], rows[:, 5])


@compiled
def _small_clusters(points: Array, x: float, y: float) -> Array:
    """Rows x, y, bearing, range, count, step."""
    n = len(points)
    rows = np.empty((n, 6))
    kept = 0
    first = _first_start(points)
    start = first
    while start < first + n:
        end = start + 1
        while end < first + n and _gap(points, end) <= GAP:
            end += 1
        if _describe(points, start, end, x, y, rows[kept]):
            kept += 1
        start = end
    return rows[:kept]


@compiled
def _gap(points: Array, k: int) -> float:
    """Metres from a hit to the one before it; the last and the first are neighbours too."""
    n = len(points)
    dx, dy = points[k % n, 0] - points[(k - 1) % n, 0], points[k % n, 1] - points[(k - 1) % n, 1]
    return math.hypot(dx, dy)


@compiled
def _first_start(points: Array) -> int:
    """The first hit that begins a cluster; 0 where all are one."""
    for k in range(len(points)):
        if _gap(points, k) > GAP:
            return k
    return 0


@compiled
def _describe(points: Array, start: int, end: int, x: float, y: float, row: Array) -> bool:
    """Write a row for the hits from ``start`` up to ``end``; False if they are too large, or too few for their
    distance."""
    n, count = len(points), end - start
    zero = math.atan2(points[start % n, 1] - y, points[start % n, 0] - x)
    low = high = 0.0
    nearest, farthest = math.inf, 0.0
    row[:] = 0.0
    for k in range(start, end):
        dx, dy = points[k % n, 0] - x, points[k % n, 1] - y
        away, aside = math.hypot(dx, dy), wrap(math.atan2(dy, dx) - zero)
        low, high = min(low, aside), max(high, aside)
        nearest, farthest = min(nearest, away), max(farthest, away)
        row[0] += points[k % n, 0] / count
        row[1] += points[k % n, 1] / count
        row[3] += away / count
    row[2], row[4] = wrap(zero + 0.5 * (low + high)), count
    row[5] = (high - low) / (count - 1) if count > 1 else 0.0
    if count < FEWEST and row[3] < NEAR:
        return False
    return (high - low) * row[3] <= LARGEST and farthest - nearest <= LARGEST
