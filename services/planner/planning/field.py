"""Fields over the cells of a grid: the distance to the nearest blocked cell, and values at points between cells."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled, compiled_nogil, inlined
from rackhand.services.planner.geometry.cells import Geometry

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]

FAR = 1e6


@compiled_nogil
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


@compiled_nogil
def near_blocked(blocked: Mask, reach: float) -> Mask:
    """Whether each cell's centre is within ``reach`` cells of a blocked cell's centre."""
    rows, columns = blocked.shape
    near = np.zeros((rows, columns), dtype=np.bool_)
    size = int(reach)
    for i in range(rows):
        for j in range(columns):
            if not blocked[i, j]:
                continue
            near[i, j] = True
            # The nearest blocked cell of a free one has a free cell beside it.
            inner = 0 < i < rows - 1 and 0 < j < columns - 1
            if inner and blocked[i - 1, j] and blocked[i + 1, j] and blocked[i, j - 1] and blocked[i, j + 1]:
                continue
            for di in range(-size, size + 1):
                for dj in range(-size, size + 1):
                    a, b = i + di, j + dj
                    if 0 <= a < rows and 0 <= b < columns and di * di + dj * dj <= reach * reach:
                        near[a, b] = True
    return near


@compiled
def _meet(row: NDArray[np.float64], q: int, v: int) -> float:
    return float(((row[q] + q * q) - (row[v] + v * v)) / (2.0 * (q - v)))


@inlined
def sample(field: Field, geometry: Geometry, x: float, y: float) -> float:
    """Bilinear value between cell centres; 0 outside (nothing is known there, so nothing is free)."""
    u = (x - geometry.x) / geometry.resolution - 0.5
    v = (y - geometry.y) / geometry.resolution - 0.5
    j = math.floor(u)
    i = math.floor(v)
    if i < 0 or j < 0 or i + 1 >= field.shape[0] or j + 1 >= field.shape[1]:
        return 0.0
    a = u - j
    b = v - i
    low = field[i, j] * (1 - a) + field[i, j + 1] * a
    high = field[i + 1, j] * (1 - a) + field[i + 1, j + 1] * a
    return float(low * (1 - b) + high * b)


@inlined
def cell_value(field: Field, geometry: Geometry, x: float, y: float, outside: float) -> float:
    """The value of the cell that holds a point, ``outside`` where there is none."""
    i = math.floor((y - geometry.y) / geometry.resolution)
    j = math.floor((x - geometry.x) / geometry.resolution)
    if i < 0 or j < 0 or i >= field.shape[0] or j >= field.shape[1]:
        return outside
    return float(field[i, j])
