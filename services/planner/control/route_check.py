"""Checks of a given route before a wheel turns (move fail reasons 4, 6, 9 and 401)."""

from __future__ import annotations

import itertools
import math

from rackhand.schemas.explain import Measure, Thing
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.control.given_line import GivenLine
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.perception.things import mapped_at
from rackhand.services.planner.planning.goals import check_goal
from rackhand.services.planner.planning.plan import Target
from rackhand.services.planner.settings import NavigationSettings

OVERLAP = 0.2  # of a cell, by which the footprint may overlap a mapped one on the line


def check_start_of_route(line: GivenLine, pose: Pose, s: NavigationSettings) -> None:
    """Raises 401 where the chassis is too far from the first point."""
    x, y = line.route.points[0]
    away = math.hypot(pose[0] - x, pose[1] - y)
    if away > s.route_join_distance:
        raise MoveFailed(
            MoveFailReason.TOO_FAR_FROM_START_OF_TRACK,
            f"the chassis is at ({pose[0]:.2f}, {pose[1]:.2f}), {away:.2f} m from the first point of the route "
            f"({x:.2f}, {y:.2f}), expected at most {s.route_join_distance:.2f} m",
        ).about(
            Thing(role="expected", kind="route point", name="1", x=float(x), y=float(y)),
            measures=(
                Measure(
                    name="distance to the first point", value=round(away, 3), expected=s.route_join_distance, unit="m"
                ),
            ),
        )


def check_points(line: GivenLine, costmap: LocalCostmap, footprint: Footprint, s: NavigationSettings) -> None:
    """Raises 4 for a point outside the map, 6 for one where the inscribed circle overlaps non-traversable cells."""
    for k, (x, y) in enumerate(line.route.points):
        try:
            check_goal(costmap, footprint, Target(float(x), float(y), None), s)
        except MoveFailed as failed:
            text = f"point {k + 1} of the route: {failed.text}"
            raise MoveFailed(failed.reason, text, failed.evidence) from None


def check_line(line: GivenLine, costmap: LocalCostmap, footprint: Footprint) -> None:
    """Raises 9 where the footprint overlaps non-traversable cells on the line, or cannot turn at a point of it."""
    for tracker in line.trackers:
        rows = tracker.leg.rows
        overlap = -OVERLAP * costmap.static.geometry.resolution
        index = next((k for k, row in enumerate(rows) if costmap.mapped.clearance(footprint, row, 0.0) < overlap), None)
        if index is not None:
            x, y, _ = rows[index]
            raise MoveFailed(
                MoveFailReason.CALCULATION_FAILED,
                f"the footprint overlaps non-traversable cells on the line after point {tracker.leg.passed[index]} of "
                f"the route, at ({x:.2f}, {y:.2f})",
            ).about(mapped_at(costmap, footprint, rows[index]))
    for before, after in itertools.pairwise(line.trackers):
        corner, yaw = before.leg.rows[-1], after.leg.rows[0, 2]
        if not _turns(costmap, footprint, corner, float(yaw)):
            raise MoveFailed(
                MoveFailReason.CALCULATION_FAILED,
                f"the footprint cannot turn by {math.degrees(wrap(yaw - corner[2])):.0f}° at point "
                f"{before.leg.passed[-1]} of the route ({corner[0]:.2f}, {corner[1]:.2f}): non-traversable cells are "
                "too near",
            ).about(mapped_at(costmap, footprint, corner, footprint.circumscribed - footprint.inscribed))


def _turns(costmap: LocalCostmap, footprint: Footprint, corner: Pose, yaw: float) -> bool:
    """Whether a turn on the spot to ``yaw`` is free on the map, one way round or the other."""
    turn = wrap(yaw - corner[2])
    return any(
        costmap.mapped.turn_clearance(footprint, corner, way) >= 0.0
        for way in (turn, turn - math.copysign(2.0 * math.pi, turn))
    )
