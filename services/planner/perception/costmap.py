"""What a metre costs around the chassis, as bytes: for those who look."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rackhand.services.planner.planning.distance_grid import DistanceGrid

MAX_NON_LETHAL, TOO_CLOSE, BLOCKED = 252, 253, 254


def cost_bytes(room: DistanceGrid, inscribed: float, comfort: float) -> NDArray[np.uint8]:
    """(rows, columns) of ``rackhand.schemas.chassis.Costmap``: the share of ``field.crowding`` beyond 1, scaled to 252.

    ``inscribed`` is the radius that fits the body anywhere, ``comfort`` the clearance beyond it that costs nothing.
    """
    clearance = room.distance - 0.5 * room.geometry.resolution - inscribed
    lack = np.clip((comfort - clearance) / comfort, 0.0, 1.0)
    cost: NDArray[np.uint8] = np.round(MAX_NON_LETHAL * lack * lack).astype(np.uint8)
    cost[clearance < 0.0] = TOO_CLOSE
    cost[room.distance == 0.0] = BLOCKED
    return cost
