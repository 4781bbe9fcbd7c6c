"""The local costmap as bytes, for the topic of that name."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rackhand.services.planner.planning.distance_grid import DistanceGrid

MAX_NON_LETHAL, TOO_CLOSE, BLOCKED = 252, 253, 254


def cost_bytes(grid: DistanceGrid, inscribed: float, inflation_radius: float) -> NDArray[np.uint8]:
    """(rows, columns) of ``rackhand.schemas.chassis.Costmap``: ``inflation_cost`` beyond 1 as a share of its weight,
    scaled to 252.

    ``inscribed``: radius of the circle that fits into the footprint; ``inflation_radius``: clearance beyond it that
    costs nothing; both in metres.
    """
    clearance = grid.distance - 0.5 * grid.geometry.resolution - inscribed
    lack = np.clip((inflation_radius - clearance) / inflation_radius, 0.0, 1.0)
    cost: NDArray[np.uint8] = np.round(MAX_NON_LETHAL * lack * lack).astype(np.uint8)
    cost[clearance < 0.0] = TOO_CLOSE
    cost[grid.distance == 0.0] = BLOCKED
    return cost
