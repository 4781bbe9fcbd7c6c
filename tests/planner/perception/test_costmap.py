"""The costs that are shown are those that are planned with."""

from __future__ import annotations

import numpy as np

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.perception.costmap import BLOCKED, MAX_NON_LETHAL, TOO_CLOSE, cost_bytes
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.inflation import Inflation, inflation_cost

RESOLUTION, INSCRIBED, RADIUS = 0.05, 0.23, 0.5


def test_a_cell_costs_what_the_plan_pays_for_it() -> None:
    blocked = np.zeros((3, 60), dtype=np.bool_)
    blocked[:, 0] = True
    room = DistanceGrid.of(blocked, Geometry(0.0, 0.0, RESOLUTION, *blocked.shape))
    cost = cost_bytes(room, INSCRIBED, RADIUS)
    assert cost.shape == blocked.shape
    assert (cost[:, 0] == BLOCKED).all()
    for column in range(1, 60):
        clearance = (column - 0.5) * RESOLUTION - INSCRIBED
        if clearance < -1e-6:
            assert cost[1, column] == TOO_CLOSE
        else:
            paid = inflation_cost(clearance, Inflation(INSCRIBED, RADIUS, 1.0)) - 1.0
            assert abs(cost[1, column] - MAX_NON_LETHAL * paid) <= 1
    assert cost[1, -1] == 0
