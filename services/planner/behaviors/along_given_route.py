"""``along_given_route``: drive to the first point of a route, and along its line to the last one.

With ``detour_tolerance`` 0, or without one, the chassis never leaves the line: it stops in front of an obstacle and
waits for as long as it is there. Larger bends are turned on the spot, small ones rounded within 2 cm of the line. With
``target_ori`` it turns to that heading at the end. ``target_x`` and ``target_y`` are not used.

With a tolerance above 2 cm it goes round obstacles, its origin never farther off the line than that, and follows the
line again behind them.

Why such a move fails, beside the reasons of a ``standard`` move for the drive to the first point and for the turn at
the end (3, 5, 9, 10, 11, 14, 15, 18):

==== ========================== =======================================================================================
  #  reason                     raised
==== ========================== =======================================================================================
  4  ending_point_out_of_map    at start: a point of the route is outside the map
  6  ending_point_not_in_       at start: the inscribed circle at a point of the route overlaps cells that are not
     ground                     traversable
  9  calculation_failed         at start, without a tolerance: the footprint overlaps such cells on the line between
                                two points, or cannot turn at a point
 14  planning_timeout           with a tolerance: no way round an obstacle for ``planning_timeout``
 15  move_timeout               nothing blocks the line, but no progress for ``move_timeout``: the chassis does not
                                follow velocity commands
400  invalid_track_points       ``route_coordinates`` has an odd count of numbers, fewer than two different points,
                                something that is no number, or more than 5 km
401  too_far_from_start_of_     at start: the first point is farther than ``route_join_distance`` from the chassis
     track
==== ========================== =======================================================================================
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.base import Behavior, Context, Done, Drive, Status
from rackhand.services.planner.behaviors.detour import Detour
from rackhand.services.planner.behaviors.drive_to_pose import DriveToPose
from rackhand.services.planner.control.given_line import GivenLine, must_wait
from rackhand.services.planner.control.goal_checker import is_still
from rackhand.services.planner.control.progress_checker import ProgressWatch
from rackhand.services.planner.control.route_check import check_line, check_points, check_start_of_route
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.planning.given_route import GivenRoute, parse_route
from rackhand.services.planner.planning.goals import Goal

Stage = Literal["joining", "following", "turning", "done"]


def for_request(request: MoveCreate) -> Behavior:
    """Raises ``MoveFailed(INVALID_TRACK_POINTS)``."""
    return AlongRoute(parse_route(request.route_coordinates), request.detour_tolerance or 0.0, request.target_ori)


class AlongRoute:
    """Stages: ``joining`` the line (at its start, or where the chassis was pushed off it), ``following`` it,
    ``turning`` to the heading at the end, ``done``."""

    _progress: ProgressWatch
    _unblocked: ProgressWatch

    def __init__(self, route: GivenRoute, tolerance: float = 0.0, final_yaw: float | None = None) -> None:
        """``tolerance``: metres that the chassis may leave the line by, to get round an obstacle."""
        self._line = GivenLine(route)
        self._tolerance = tolerance
        self._detour = Detour(tolerance)
        self._final_yaw = final_yaw
        self._begun = False
        self._stage: Stage = "joining"
        self._drive: Behavior | None = None
        self._free = math.inf
        self._waits = False
        self._status = Status()

    # -- interface ---------------------------------------------------------------------------------------------------

    def step(self, ctx: Context) -> Drive | Done:
        if not self._begun:
            self._begin(ctx)
        if self._drive is not None:
            outcome = self._drive.step(ctx)
            self._status = self._during(self._drive.status())
            if isinstance(outcome, Drive):
                return outcome
            self._drive_ended(ctx)
        wanted = self._follow(ctx) if self._stage == "following" else STANDSTILL
        if self._drive is None:
            self._status = self._measured(ctx)
        return Done() if self._stage == "done" else Drive(wanted)

    def resume(self, ctx: Context) -> None:
        if self._drive is not None:
            self._drive.resume(ctx)
        elif self._begun:
            self._progress.restart(ctx.stamp)
            self._unblocked.restart(ctx.stamp)
            self._detour.resume(ctx, ctx.settings.off_line_distance)

    def status(self) -> Status:
        return self._status

    # -- stages ------------------------------------------------------------------------------------------------------

    def _begin(self, ctx: Context) -> None:
        check_start_of_route(self._line, ctx.pose, ctx.settings)
        check_points(self._line, ctx.costmap, ctx.footprint, ctx.settings)
        if not self._tolerance:
            check_line(self._line, ctx.costmap, ctx.footprint)
        self._begun = True
        self._join()

    def _join(self) -> None:
        """Drive to the place on the line that the chassis has got to."""
        x, y, yaw = (float(value) for value in self._line.rows[self._line.row])
        self._stage, self._drive = "joining", DriveToPose(Goal(x, y, yaw))

    def _drive_ended(self, ctx: Context) -> None:
        """On the line, or turned to the heading at its end."""
        self._drive = None
        if self._stage == "turning":
            self._stage = "done"
        else:
            self._stage = "following"
            self._progress = ProgressWatch(ctx.settings, ctx.stamp)
            self._unblocked = ProgressWatch(ctx.settings, ctx.stamp)

    def _follow(self, ctx: Context) -> Twist2:
        line, s = self._line, ctx.settings
        line.update(ctx.pose)
        self._free, row = line.free_distance(ctx.costmap, ctx.footprint, s.path_check_distance)
        wanted = self._detour.twist(ctx, line, None if math.isinf(self._free) else row)
        if wanted is None and line.current.tracker.deviation > s.off_line_distance:
            self._join()
            return STANDSTILL
        if wanted is None and line.has_ended(ctx.pose):
            return self._end_of_leg(ctx)
        if wanted is None:
            wanted = self._along_the_line(ctx)
        self._measure_progress(ctx, wanted)
        return wanted

    def _along_the_line(self, ctx: Context) -> Twist2:
        line = self._line
        if must_wait(ctx.pose, ctx.twist, line.ahead(), ctx.costmap.movers.rows(), ctx.footprint):
            return STANDSTILL
        return line.current.follow(ctx.predicted, ctx.twist, self._free, ctx.costmap, ctx.footprint, ctx.settings)

    def _end_of_leg(self, ctx: Context) -> Twist2:
        if not is_still(ctx.twist):
            return STANDSTILL
        if not self._line.is_last:
            self._line.advance()
        elif self._final_yaw is None:
            self._stage = "done"
        else:
            self._stage, self._drive = "turning", DriveToPose(Goal(yaw=self._final_yaw))
        return STANDSTILL

    # -- progress ----------------------------------------------------------------------------------------------------

    def _measure_progress(self, ctx: Context, wanted: Twist2) -> None:
        line, tracker = self._line, self._line.current
        if self._detour.route is not None:
            what, left = f"detour {self._detour.plans}", self._detour.left(line, ctx.pose)
        elif tracker.tracker.aligned:
            what, left = "line", line.left(ctx.pose)
        else:
            what, left = f"turn at point {line.passed}", abs(tracker.errors(ctx.pose)[1])
        self._waits = ctx.vetoed or (wanted.linear == 0.0 and wanted.angular == 0.0)
        for watch in (self._progress, self._unblocked):
            watch.update(ctx.stamp, what, left)
        if self._waits:
            self._unblocked.restart(ctx.stamp)
        self._unblocked.check(ctx.stamp, "driving", "the chassis does not follow velocity commands")

    def _measured(self, ctx: Context) -> Status:
        line, detour, following = self._line, self._detour, self._stage == "following"
        return Status(
            target=self._target(),
            path=detour.ahead(line) if following else self._status.path[:0],
            remaining_distance=detour.left(line, ctx.pose) if following else 0.0,
            stuck_state=self._progress.stuck_state(ctx.stamp, "driving") if following else "none",
            viewport_blocked=following and self._waits,
            plans=1 + detour.plans,
            passed_points=line.passed,
        )

    def _during(self, status: Status) -> Status:
        """Of the drive to the line or the turn at its end, as part of this move."""
        line_left = self._line.left(self._line.rows[self._line.row]) if self._stage == "joining" else 0.0
        return replace(
            status,
            target=self._target(),
            remaining_distance=status.remaining_distance + line_left,
            passed_points=self._status.passed_points,
        )

    def _target(self) -> Pose2:
        x, y, yaw = (float(value) for value in self._line.rows[-1])
        return Pose2(x=x, y=y, yaw=yaw if self._final_yaw is None else self._final_yaw)
