"""Distance to the nearest obstacle, and the cost to go to a goal, for every cell."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.services.planner.planning.heap import grown, pop, push

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]

FAR = 1e6


@compiled
def distance_field(blocked: Mask, resolution: float) -> Field:
    """Metres from each cell's centre to the nearest blocked cell's centre (0 in blocked ones, FAR if there is none).

    Exact Euclidean transform by lower envelopes of parabolas, columns then rows (Felzenszwalb & Huttenlocher 2012).
    """
    rows, columns = blocked.shape
    squared = np.empty((rows, columns), dtype=np.float64)
    for j in range(columns):
        gap = FAR
        for i in range(rows):
            gap = 0.0 if blocked[i, j] else gap + 1.0
            squared[i, j] = gap
        gap = FAR
        for i in range(rows - 1, -1, -1):
            gap = 0.0 if blocked[i, j] else gap + 1.0
            squared[i, j] = min(squared[i, j], gap)
    distance = np.empty((rows, columns), dtype=np.float32)
    vertex = np.empty(columns, dtype=np.int64)
    border = np.empty(columns + 1, dtype=np.float64)
    row = np.empty(columns, dtype=np.float64)
    for i in range(rows):
        for j in range(columns):
            row[j] = squared[i, j] ** 2
        k = 0
        vertex[0] = 0
        border[0] = -np.inf
        border[1] = np.inf
        for q in range(1, columns):
            meet = _meet(row, q, vertex[k])
            while meet <= border[k]:
                k -= 1
                meet = _meet(row, q, vertex[k])
            k += 1
            vertex[k] = q
            border[k] = meet
            border[k + 1] = np.inf
        k = 0
        for q in range(columns):
            while border[k + 1] < q:
                k += 1
            distance[i, q] = min(math.sqrt((q - vertex[k]) ** 2 + row[vertex[k]]), FAR) * resolution
    return distance


@compiled
def _meet(row: NDArray[np.float64], q: int, v: int) -> float:
    return float(((row[q] + q * q) - (row[v] + v * v)) / (2.0 * (q - v)))


@compiled
def sample(field: Field, x0: float, y0: float, resolution: float, x: float, y: float) -> float:
    """Bilinear value between cell centres; 0 outside (nothing is known there, so nothing is free)."""
    u = (x - x0) / resolution - 0.5
    v = (y - y0) / resolution - 0.5
    j = math.floor(u)
    i = math.floor(v)
    if i < 0 or j < 0 or i + 1 >= field.shape[0] or j + 1 >= field.shape[1]:
        return 0.0
    a = u - j
    b = v - i
    low = field[i, j] * (1 - a) + field[i, j + 1] * a
    high = field[i + 1, j] * (1 - a) + field[i + 1, j + 1] * a
    return float(low * (1 - b) + high * b)


@compiled
def crowding(clearance: float, comfort: float, weight: float) -> float:
    """Factor on the cost of a metre: 1 where there is room, 1 + weight where the inscribed circle touches."""
    if clearance >= comfort:
        return 1.0
    lack = (comfort - max(clearance, 0.0)) / comfort
    return 1.0 + weight * lack * lack


@compiled
def cost_to_go(
    distance: Field,
    resolution: float,
    goal_row: int,
    goal_column: int,
    radius: float,
    comfort: float,
    weight: float,
    max_expansions: int,
) -> tuple[Field, NDArray[np.int32], int]:
    """Dijkstra from the goal over cells where a circle of ``radius`` is free.

    Returns the cost in metres (weighted by crowding; infinite where there is no way), the index of the next cell
    toward the goal (-1 for none), and the number of expanded cells, which is ``max_expansions`` if that cut it short.
    """
    rows, columns = distance.shape
    cost = np.full((rows, columns), np.inf, dtype=np.float32)
    toward = np.full(rows * columns, -1, dtype=np.int32)
    keys = np.empty(4 * (rows + columns) + 64, dtype=np.float64)
    items = np.empty(keys.size, dtype=np.int64)
    size = 0
    expanded = 0
    cost[goal_row, goal_column] = 0.0
    size = push(keys, items, size, 0.0, goal_row * columns + goal_column)
    while size > 0 and expanded < max_expansions:
        size = pop(keys, items, size)
        here, index = keys[size], items[size]
        i, j = index // columns, index % columns
        if here > cost[i, j] + 1e-6:
            continue
        expanded += 1
        for di in range(-1, 2):
            for dj in range(-1, 2):
                a, b = i + di, j + dj
                if (di == 0 and dj == 0) or a < 0 or b < 0 or a >= rows or b >= columns:
                    continue
                clearance = distance[a, b] - 0.5 * resolution - radius
                if clearance < 0.0:
                    continue
                step = resolution * (1.4142135623730951 if di != 0 and dj != 0 else 1.0)
                there = here + step * crowding(clearance, comfort, weight)
                if there < cost[a, b] - 1e-6:
                    cost[a, b] = there
                    toward[a * columns + b] = index
                    if size == keys.size:
                        keys, items = grown(keys, items)
                    size = push(keys, items, size, there, a * columns + b)
    return cost, toward, expanded
