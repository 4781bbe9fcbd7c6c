"""Whether something that moves will come too near, if the chassis stands or goes on as it means to."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from services.planner.navigation.compiled import compiled
from services.planner.navigation.se2 import Pose

Array = NDArray[np.float64]
STEP = 0.2  # s


@compiled
def least_gap(pose: Pose, path: Array, speed: float, movers: Array, body_edges: Array, horizon: float) -> float:
    """The least distance in metres between the body and any mover within ``horizon`` seconds.

    The body goes along ``path`` (rows x, y, yaw) at ``speed``; movers (rows x, y, vx, vy, radius) go straight on.
    """
    least = 1e9
    index = 0
    travelled = 0.0
    here = pose.copy()
    for step in range(math.ceil(horizon / STEP) + 1):
        time = step * STEP
        while index + 1 < len(path) and travelled < speed * time:
            travelled += math.hypot(path[index + 1, 0] - path[index, 0], path[index + 1, 1] - path[index, 1])
            index += 1
            here[:] = path[index]
        c, s = math.cos(here[2]), math.sin(here[2])
        for m in range(movers.shape[0]):
            dx, dy = movers[m, 0] + movers[m, 2] * time - here[0], movers[m, 1] + movers[m, 3] * time - here[1]
            bx, by = c * dx + s * dy, -s * dx + c * dy
            gap = -1e9
            for e in range(body_edges.shape[0]):
                gap = max(gap, body_edges[e, 0] * bx + body_edges[e, 1] * by - body_edges[e, 2])
            least = min(least, gap - movers[m, 4])
    return least
