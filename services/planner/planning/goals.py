"""Checks of a start and a goal before anything is planned (move fail reasons 3 to 7)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rackhand.schemas.explain import Evidence, Thing
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose, message
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.perception.things import mapped_at, thing_at
from rackhand.services.planner.planning.plan import Target
from rackhand.services.planner.settings import NavigationSettings

RINGS, SPOKES = 8, 24  # of places in a zone that are looked at
RIM = 0.05  # of its radius, beside which no place is looked for
ROOM = 0.05  # m that such a place has more than the inscribed circle needs
START_OVERLAP = 0.05  # m by which the footprint may overlap mapped cells at the start: noise of pose and map


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


def check_start(costmap: LocalCostmap, footprint: Footprint, start: Pose) -> None:
    """Raises 3 outside the map, 5 where the footprint overlaps non-traversable cells."""
    where = f"the chassis is at ({start[0]:.2f}, {start[1]:.2f})"
    g = costmap.static.geometry
    if not g.contains(start[0], start[1]):
        evidence = Evidence(things=(_beyond(g, start),))
        raise MoveFailed(MoveFailReason.STARTING_POINT_OUT_OF_MAP, f"{where}, outside the map {_extent(g)}", evidence)
    overlap = -costmap.mapped.clearance(footprint, start)
    if overlap > START_OVERLAP:
        text = f"{where}, its footprint overlaps non-traversable cells by {_depth(overlap, g)}"
        evidence = _overlapped(costmap, footprint, start, -START_OVERLAP)
        raise MoveFailed(MoveFailReason.STARTING_POINT_NOT_IN_GROUND, text, evidence)
    if costmap.static.blocked[g.cell(start[0], start[1])]:
        evidence = Evidence(things=(thing_at(costmap, float(start[0]), float(start[1])),))
        raise MoveFailed(MoveFailReason.STARTING_POINT_NOT_IN_GROUND, f"{where}, in a non-traversable cell", evidence)


def zone_target(costmap: LocalCostmap, footprint: Footprint, goal: Goal, pose: Pose, ring: int = 0) -> Target | None:
    """The place in a goal's zone to aim at: the middle, or where that is occupied the free place nearest to it, of the
    nearest those nearer to the chassis. ``ring``: of the ``RINGS`` about the middle, the first that is looked at. None
    where no place in the zone is free on the map and in what is seen."""
    assert goal.x is not None and goal.y is not None
    room = footprint.inscribed + ROOM
    if ring == 0 and _is_free(costmap, goal.x, goal.y, footprint.inscribed):
        return Target(goal.x, goal.y, goal.yaw)
    towards = math.atan2(pose[1] - goal.y, pose[0] - goal.x)
    for at in range(max(ring, 1), RINGS + 1):
        away = at / RINGS * (1.0 - RIM) * goal.accuracy
        for k in range(SPOKES):
            angle = towards + (1 if k % 2 else -1) * ((k + 1) // 2) * math.tau / SPOKES
            x, y = goal.x + away * math.cos(angle), goal.y + away * math.sin(angle)
            if _is_free(costmap, x, y, room):
                return Target(x, y, None)
    return None


def _is_free(costmap: LocalCostmap, x: float, y: float, radius: float) -> bool:
    """Whether a circle is free, on the map and, where it is in view, in what is observed."""
    if not costmap.static.geometry.contains(x, y) or costmap.mapped.at(x, y) < radius:
        return False
    return not costmap.near.geometry.contains(x, y) or costmap.near.at(x, y) >= radius


def check_goal(costmap: LocalCostmap, footprint: Footprint, target: Target, s: NavigationSettings) -> None:
    """Raises 4 outside the map, 6 where the footprint would overlap non-traversable cells.

    Without a heading, the inscribed circle must be free.
    """
    where = f"the goal is at ({target.x:.2f}, {target.y:.2f})"
    g = costmap.static.geometry
    if not g.contains(target.x, target.y):
        evidence = Evidence(things=(_beyond(g, target.pose),))
        raise MoveFailed(MoveFailReason.ENDING_POINT_OUT_OF_MAP, f"{where}, outside the map {_extent(g)}", evidence)
    overlap = footprint.inscribed - costmap.mapped.at(target.x, target.y)
    if target.yaw is not None:
        overlap = max(overlap, -costmap.mapped.clearance(footprint, target.pose))
    if overlap > -s.ground_margin:
        margin = f" (margin {s.ground_margin:.2f} m)" if s.ground_margin else ""
        text = f"{where}, the goal footprint overlaps non-traversable cells by {_depth(overlap, g)}{margin}"
        evidence = _overlapped(costmap, footprint, target.pose, s.ground_margin)
        raise MoveFailed(MoveFailReason.ENDING_POINT_NOT_IN_GROUND, text, evidence)
    if costmap.static.blocked[g.cell(target.x, target.y)]:
        evidence = Evidence(things=(thing_at(costmap, target.x, target.y),))
        raise MoveFailed(MoveFailReason.ENDING_POINT_NOT_IN_GROUND, f"{where}, in a non-traversable cell", evidence)


def _overlapped(costmap: LocalCostmap, footprint: Footprint, pose: Pose, needed: float) -> Evidence:
    thing = mapped_at(costmap, footprint, pose, needed)
    return Evidence() if thing is None else Evidence(things=(thing,))


def _beyond(g: Geometry, pose: Pose) -> Thing:
    """The place of the map's edge nearest to a pose outside."""
    x = min(max(float(pose[0]), g.x), g.x + g.columns * g.resolution)
    y = min(max(float(pose[1]), g.y), g.y + g.rows * g.resolution)
    away = math.hypot(x - pose[0], y - pose[1])
    return Thing(role="blocks", kind="edge of the map", x=x, y=y, clearance=-away, needed=0.0, at=message(pose))


def _depth(overlap: float, g: Geometry) -> str:
    """The depth of an overlap; the search for the deepest place ends at the first deeper than a cell."""
    return f"{overlap:.2f} m" + (" or more" if overlap > g.resolution else "")


def _extent(g: Geometry) -> str:
    return f"({g.x:.2f}, {g.y:.2f}) to ({g.x + g.columns * g.resolution:.2f}, {g.y + g.rows * g.resolution:.2f})"
