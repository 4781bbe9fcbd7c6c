"""The cost to go from every cell to a goal, for the inscribed circle of the footprint."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled, compiled_nogil
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.field import Field
from rackhand.services.planner.planning.inflation import Inflation, inflation_cost

DIAGONAL = 1.4142135623730951
EVERYWHERE = -1

Integers = NDArray[np.int32]


@compiled_nogil
def cost_to_go(
    grid: DistanceGrid,
    goal_row: int,
    goal_column: int,
    inflation: Inflation,
    max_expansions: int,
    start: int = EVERYWHERE,
    start_reach: float = 0.0,
    beyond: float = 0.0,
) -> tuple[Field, Integers, int]:
    """Dijkstra from the goal over the cells where the inscribed circle is free, 8 neighbours to a cell.

    Returns the cost in metres weighted by inflation (infinite where no path exists), the index of the next cell toward
    the goal (-1 for none), and the number of expanded cells, which is ``max_expansions`` if that cut it short. With the
    index of a cell as ``start`` the search ends when all is known that is at most ``beyond`` costlier than the first
    cell within ``start_reach`` cells of it.

    The queue is one of buckets, each as wide as the cheapest step (Dial 1969, Denardo & Fox 1979): no cell of a bucket
    can improve another, so each is expanded once, at its final cost, without sorting.
    """
    distance, resolution = grid.distance, grid.geometry.resolution
    rows, columns = distance.shape
    price = step_prices(distance, resolution, inflation)
    cost = np.full((rows, columns), np.inf, dtype=np.float32)
    toward = np.full(rows * columns, -1, dtype=np.int32)
    width = 0.999 * resolution  # below any step, also after rounding to float32
    buckets = math.ceil(DIAGONAL * resolution * (1.0 + max(inflation.weight, 0.0)) / width) + 2
    heads = np.full(buckets, -1, dtype=np.int32)
    nodes = np.empty((1024, 2), dtype=np.int32)  # cell, next node of its bucket
    nodes_used, free, waiting, expanded, limit = 1, -1, 1, 0, np.inf
    cost[goal_row, goal_column] = 0.0
    nodes[0, 0], nodes[0, 1], heads[0] = goal_row * columns + goal_column, -1, 0
    level = 0
    while waiting > 0 and expanded < max_expansions and level * width <= limit:
        node = heads[level % buckets]
        if node < 0:
            level += 1
            continue
        index = nodes[node, 0]
        heads[level % buckets] = nodes[node, 1]
        nodes[node, 1], free = free, node
        waiting -= 1
        i, j = index // columns, index % columns
        here = cost[i, j]
        if here < level * width:
            continue  # expanded already, at a lower cost than this entry had
        if price[i, j] < 0.0 and index != goal_row * columns + goal_column:
            continue
        price[i, j] = -1.0  # expanded: neither entered nor expanded again
        expanded += 1
        if start >= 0 and limit == np.inf and math.hypot(i - start // columns, j - start % columns) <= start_reach:
            limit = here + beyond
        for di in range(-1, 2):
            for dj in range(-1, 2):
                a, b = i + di, j + dj
                if a < 0 or b < 0 or a >= rows or b >= columns or price[a, b] < 0.0:
                    continue
                there = np.float32(here + price[a, b] * (DIAGONAL if di != 0 and dj != 0 else 1.0))
                if there < cost[a, b]:
                    cost[a, b] = there
                    toward[a * columns + b] = index
                    if free < 0:
                        if nodes_used == len(nodes):
                            nodes = grown(nodes)
                        free = nodes_used
                        nodes[free, 1] = -1
                        nodes_used += 1
                    node, free = free, nodes[free, 1]
                    bucket = int(there / width) % buckets
                    nodes[node, 0], nodes[node, 1] = a * columns + b, heads[bucket]
                    heads[bucket] = node
                    waiting += 1
    return cost, toward, expanded


@compiled
def step_prices(distance: Field, resolution: float, inflation: Inflation) -> Field:
    """Cost of a straight step into each cell, -1 where the inscribed circle is not free."""
    rows, columns = distance.shape
    price = np.empty((rows, columns), dtype=np.float32)
    for i in range(rows):
        for j in range(columns):
            clearance = distance[i, j] - 0.5 * resolution - inflation.inscribed
            price[i, j] = -1.0 if clearance < 0.0 else resolution * inflation_cost(clearance, inflation)
    return price


@compiled
def grown(nodes: Integers) -> Integers:
    """With twice the room."""
    larger = np.empty((2 * len(nodes), 2), dtype=np.int32)
    larger[: len(nodes)] = nodes
    return larger
