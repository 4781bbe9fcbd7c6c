"""What is wrong with a start or a goal before anything is planned (reasons 3-7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.planning.plan import Target
from rackhand.services.planner.settings import NavigationSettings

START_OVERLAP = 0.05  # m of the body in mapped things that noise of pose and map may explain


@dataclass(frozen=True)
class Goal:
    """A pose in the map to drive to. ``None`` for x, y: stay there and rotate; ``None`` for yaw: any heading.

    ``accuracy`` in metres. ``zone``: done as soon as within ``accuracy``, without stopping at the point or rotating.
    ``rotate_in_place``: turn without any linear velocity.
    """

    x: float | None = None
    y: float | None = None
    yaw: float | None = None
    accuracy: float = 0.03
    zone: bool = False
    rotate_in_place: bool = False


def check_start(around: LocalCostmap, footprint: Footprint, start: Pose) -> None:
    """Raises 3 outside the grid, 5 where the body stands in what is no ground."""
    where = f"the chassis is at ({start[0]:.2f}, {start[1]:.2f})"
    g = around.static.geometry
    if not g.contains(start[0], start[1]):
        raise MoveFailed(MoveFailReason.STARTING_POINT_OUT_OF_MAP, f"{where}, outside the map {_extent(around)}")
    free = around.mapped.clearance(footprint, start)
    if around.static.blocked[g.cell(start[0], start[1])] or free < -START_OVERLAP:
        raise MoveFailed(
            MoveFailReason.STARTING_POINT_NOT_IN_GROUND,
            f"{where}, where its footprint overlaps non-traversable cells by {-free:.2f} m",
        )


def check_goal(around: LocalCostmap, footprint: Footprint, target: Target, s: NavigationSettings) -> None:
    """Raises 4 outside the grid, 6 where the body would stand in what is no ground."""
    where = f"the goal is at ({target.x:.2f}, {target.y:.2f})"
    g = around.static.geometry
    if not g.contains(target.x, target.y):
        raise MoveFailed(MoveFailReason.ENDING_POINT_OUT_OF_MAP, f"{where}, outside the map {_extent(around)}")
    lack = footprint.inscribed - around.mapped.at(target.x, target.y)
    if target.yaw is not None:
        lack = max(lack, -around.mapped.clearance(footprint, np.array([target.x, target.y, target.yaw])))
    if around.static.blocked[g.cell(target.x, target.y)] or lack > -s.ground_margin:
        raise MoveFailed(
            MoveFailReason.ENDING_POINT_NOT_IN_GROUND,
            f"{where}, where the goal footprint overlaps non-traversable cells by {lack:.2f} m",
        )


def _extent(around: LocalCostmap) -> str:
    g = around.static.geometry
    return f"({g.x:.2f}, {g.y:.2f}) to ({g.x + g.columns * g.resolution:.2f}, {g.y + g.rows * g.resolution:.2f})"
