"""From a chain of cells to a drivable path: pulled tight, resampled, smoothed away from obstacles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled, compiled_nogil
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.field import sample
from rackhand.services.planner.planning.inflation import Inflation, inflation_cost

Array = NDArray[np.float64]

COST_SLACK = 1.01  # a straight line may cost this much of what it replaces
MAX_MISSES = 12  # points in a row that no cheap line reaches, before the search for a farther one ends
COARSE_AFTER, COARSE_STEP = 20, 4  # beyond so many points, only every fourth is tried
CONTRACTION, REPULSION = 0.5, 0.1  # of the elastic band, per round


@compiled
def chain(toward: NDArray[np.int32], start: int, geometry: Geometry) -> Array:
    """Centres (n, 2) of the cells from the index ``start`` to the goal, following ``toward`` of ``cost_to_go``."""
    n = 1
    index = start
    while toward[index] >= 0:
        index = toward[index]
        n += 1
    points = np.empty((n, 2), dtype=np.float64)
    index = start
    for k in range(n):
        points[k, 0] = geometry.x + (index % geometry.columns + 0.5) * geometry.resolution
        points[k, 1] = geometry.y + (index // geometry.columns + 0.5) * geometry.resolution
        index = toward[index]
    return points


@compiled
def line_cost(grid: DistanceGrid, inflation: Inflation, a: Array, b: Array) -> float:
    """Metres weighted by inflation along a straight line; infinite where the inscribed circle is not free."""
    resolution = grid.geometry.resolution
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    n = math.ceil(length / resolution) + 1
    total = 0.0
    for k in range(n + 1):
        t = k / n
        free = sample(grid.distance, grid.geometry, a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]))
        free -= 0.5 * resolution + inflation.inscribed
        if free < 0.0:
            return np.inf
        total += inflation_cost(free, inflation)
    return total / (n + 1) * length


@compiled_nogil
def pull_tight(grid: DistanceGrid, inflation: Inflation, points: Array) -> Array:
    """Corners (m, 2) of a shorter polyline: straight lines that cost no more than the part of the chain they
    replace."""
    cost = cost_along(grid, inflation, points)
    n = len(points)
    corners = np.empty((n, 2))
    corners[0] = points[0]
    m = 1
    here = 0
    while here < n - 1:
        here = _farthest_in_line(grid, inflation, points, cost, here)
        corners[m] = points[here]
        m += 1
    return corners[:m].copy()


@compiled
def cost_along(grid: DistanceGrid, inflation: Inflation, points: Array) -> Array:
    """For each point the cost from the first one: metres, weighted by the inflation at the end of each step."""
    cost = np.zeros(len(points))
    for k in range(1, len(points)):
        free = sample(grid.distance, grid.geometry, points[k, 0], points[k, 1])
        free -= 0.5 * grid.geometry.resolution + inflation.inscribed
        step = math.hypot(points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1])
        cost[k] = cost[k - 1] + step * inflation_cost(free, inflation)
    return cost


@compiled
def _farthest_in_line(grid: DistanceGrid, inflation: Inflation, points: Array, cost: Array, here: int) -> int:
    """The index of a far point that a straight line from ``here`` reaches at no more than the chain's cost."""
    reach = here + 1
    misses = 0
    k = here + 2
    while k < len(points) and misses < MAX_MISSES:
        if line_cost(grid, inflation, points[here], points[k]) <= (cost[k] - cost[here]) * COST_SLACK:
            reach = k
            misses = 0
        else:
            misses += 1
        k += 1 if k - here < COARSE_AFTER else COARSE_STEP
    return reach


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


@compiled_nogil
def smooth(grid: DistanceGrid, points: Array, wanted: float, rounds: int) -> Array:
    """An elastic band (Quinlan & Khatib 1993): each inner point is drawn to the middle of its neighbours, and up the
    distance field where it is less than ``wanted`` metres from a blocked cell's centre.

    The ends stay, and no point gives up clearance it needs.
    """
    path = points.copy()
    for _ in range(rounds):
        for k in range(1, len(path) - 1):
            x = path[k, 0] + CONTRACTION * (0.5 * (path[k - 1, 0] + path[k + 1, 0]) - path[k, 0])
            y = path[k, 1] + CONTRACTION * (0.5 * (path[k - 1, 1] + path[k + 1, 1]) - path[k, 1])
            before = sample(grid.distance, grid.geometry, path[k, 0], path[k, 1])
            after = sample(grid.distance, grid.geometry, x, y)
            if after < wanted:
                dx, dy = _uphill(grid, x, y)
                x += REPULSION * (wanted - after) * dx
                y += REPULSION * (wanted - after) * dy
                after = sample(grid.distance, grid.geometry, x, y)
            if after >= min(before, wanted):
                path[k, 0] = x
                path[k, 1] = y
    return path


@compiled
def _uphill(grid: DistanceGrid, x: float, y: float) -> tuple[float, float]:
    """Unit vector along which the distance grows most; zero where it is flat."""
    field, geometry, h = grid.distance, grid.geometry, grid.geometry.resolution
    gx = sample(field, geometry, x + h, y) - sample(field, geometry, x - h, y)
    gy = sample(field, geometry, x, y + h) - sample(field, geometry, x, y - h)
    norm = math.hypot(gx, gy)
    return (gx / norm, gy / norm) if norm > 1e-6 else (0.0, 0.0)


def headings(points: Array) -> Array:
    """Rows x, y, yaw: each point with the direction to the next; the last one with the direction from the former."""
    if len(points) < 2:
        return np.column_stack([points, np.zeros(len(points))])
    steps = np.diff(points, axis=0)
    yaw = np.arctan2(steps[:, 1], steps[:, 0])
    return np.column_stack([points, np.append(yaw, yaw[-1])])
