"""The cost to go from every cell to a goal, for the inscribed circle of the footprint."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled_nogil
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.field import Field
from rackhand.services.planner.planning.heap import grown, pop, push
from rackhand.services.planner.planning.inflation import Inflation, inflation_cost

DIAGONAL = 1.4142135623730951


@compiled_nogil
def cost_to_go(
    grid: DistanceGrid, goal_row: int, goal_column: int, inflation: Inflation, max_expansions: int
) -> tuple[Field, NDArray[np.int32], int]:
    """Dijkstra from the goal over the cells where the inscribed circle is free, 8 neighbours to a cell.

    Returns the cost in metres weighted by inflation (infinite where no path exists), the index of the next cell toward
    the goal (-1 for none), and the number of expanded cells, which is ``max_expansions`` if that cut it short.
    """
    distance, resolution = grid.distance, grid.geometry.resolution
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
        if here > cost[i, j]:
            continue
        expanded += 1
        for di in range(-1, 2):
            for dj in range(-1, 2):
                a, b = i + di, j + dj
                if (di == 0 and dj == 0) or a < 0 or b < 0 or a >= rows or b >= columns:
                    continue
                clearance = distance[a, b] - 0.5 * resolution - inflation.inscribed
                if clearance < 0.0:
                    continue
                step = resolution * (DIAGONAL if di != 0 and dj != 0 else 1.0)
                # Rounded as it is stored: a cell is then expanded once, however far it is from the goal.
                there = float(np.float32(here + step * inflation_cost(clearance, inflation)))
                if there < cost[a, b]:
                    cost[a, b] = there
                    toward[a * columns + b] = index
                    if size == keys.size:
                        keys, items = grown(keys, items)
                    size = push(keys, items, size, there, a * columns + b)
    return cost, toward, expanded
