"""From a chain of cells to a path worth driving: pulled tight, then smoothed away from obstacles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.services.planner.planning.field import Field, crowding, sample

Array = NDArray[np.float64]


@compiled
def chain(toward: NDArray[np.int32], columns: int, start: int, x0: float, y0: float, resolution: float) -> Array:
    """Cell centres from the cell index ``start`` to the goal."""
    n = 1
    index = start
    while toward[index] >= 0:
        index = toward[index]
        n += 1
    points = np.empty((n, 2), dtype=np.float64)
    index = start
    for k in range(n):
        points[k, 0] = x0 + (index % columns + 0.5) * resolution
        points[k, 1] = y0 + (index // columns + 0.5) * resolution
        index = toward[index]
    return points


@compiled
def _line_cost(
    distance: Field, x0: float, y0: float, resolution: float, a: Array, b: Array, radius: float, comfort: float,
    weight: float,
) -> float:  # fmt: skip
    """Metres weighted by crowding along a straight line; infinite where the circle is not free."""
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    n = math.ceil(length / resolution) + 1
    total = 0.0
    for k in range(n + 1):
        t = k / n
        free = sample(distance, x0, y0, resolution, a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]))
        free -= 0.5 * resolution + radius
        if free < 0.0:
            return np.inf
        total += crowding(free, comfort, weight)
    return total / (n + 1) * length


@compiled
def pull_tight(
    distance: Field, x0: float, y0: float, resolution: float, points: Array, radius: float, comfort: float,
    weight: float,
) -> Array:  # fmt: skip
    """Corners of a shorter polyline: straight lines that cost no more than the stretch of the chain they replace."""
    n = len(points)
    cost = np.zeros(n)
    for k in range(1, n):
        cost[k] = cost[k - 1] + _line_cost(
            distance, x0, y0, resolution, points[k - 1], points[k], 0.0, comfort + radius, 0.0
        ) * crowding(
            sample(distance, x0, y0, resolution, points[k, 0], points[k, 1]) - 0.5 * resolution - radius,
            comfort,
            weight,
        )
    corners = np.empty((n, 2))
    corners[0] = points[0]
    m = 1
    here = 0
    while here < n - 1:
        reach = here + 1
        step = 1
        misses = 0
        k = here + 2
        while k < n and misses < 12:
            line = _line_cost(distance, x0, y0, resolution, points[here], points[k], radius, comfort, weight)
            if line <= (cost[k] - cost[here]) * 1.01:
                reach = k
                misses = 0
            else:
                misses += 1
            step = 1 if k - here < 20 else 4
            k += step
        corners[m] = points[reach]
        m += 1
        here = reach
    return corners[:m].copy()


@compiled
def resample(corners: Array, spacing: float) -> Array:
    """Points at most ``spacing`` apart along a polyline, its corners and ends among them."""
    total = 1
    for k in range(1, len(corners)):
        side = corners[k] - corners[k - 1]
        total += max(1, math.ceil(math.hypot(side[0], side[1]) / spacing))
    points = np.empty((total, 2))
    points[0] = corners[0]
    m = 1
    for k in range(1, len(corners)):
        side = corners[k] - corners[k - 1]
        n = max(1, math.ceil(math.hypot(side[0], side[1]) / spacing))
        for i in range(1, n + 1):
            points[m] = corners[k - 1] + side * (i / n)
            m += 1
    return points


@compiled
def smooth(distance: Field, x0: float, y0: float, resolution: float, points: Array, room: float, rounds: int) -> Array:
    """An elastic band: each inner point drawn to the middle of its neighbours, and up the distance field where it has
    less than ``room``. The ends stay, and no point gives up clearance it needs."""
    path = points.copy()
    n = len(path)
    for _ in range(rounds):
        for k in range(1, n - 1):
            x = path[k, 0] + 0.5 * (0.5 * (path[k - 1, 0] + path[k + 1, 0]) - path[k, 0])
            y = path[k, 1] + 0.5 * (0.5 * (path[k - 1, 1] + path[k + 1, 1]) - path[k, 1])
            before = sample(distance, x0, y0, resolution, path[k, 0], path[k, 1])
            after = sample(distance, x0, y0, resolution, x, y)
            if after < room:
                h = resolution
                gx = sample(distance, x0, y0, resolution, x + h, y) - sample(distance, x0, y0, resolution, x - h, y)
                gy = sample(distance, x0, y0, resolution, x, y + h) - sample(distance, x0, y0, resolution, x, y - h)
                norm = math.hypot(gx, gy)
                if norm > 1e-6:
                    push = 0.1 * (room - after)
                    x += push * gx / norm
                    y += push * gy / norm
                    after = sample(distance, x0, y0, resolution, x, y)
            if after >= min(before, room):
                path[k, 0] = x
                path[k, 1] = y
    return path


def headings(points: Array) -> Array:
    """Rows x, y, yaw: each point with the direction of the way on; the last one that of the way there."""
    if len(points) < 2:
        return np.column_stack([points, np.zeros(len(points))])
    steps = np.diff(points, axis=0)
    yaw = np.arctan2(steps[:, 1], steps[:, 0])
    return np.column_stack([points, np.append(yaw, yaw[-1])])
