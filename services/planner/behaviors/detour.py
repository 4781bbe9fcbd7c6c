"""Round an obstacle on a given line, within a tolerance, and back onto the line behind it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import NANOSECONDS, Twist2
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.behaviors.base import Context
from rackhand.services.planner.control import driving
from rackhand.services.planner.control.given_line import GivenLine, must_wait
from rackhand.services.planner.control.goal_checker import is_still
from rackhand.services.planner.control.route import Route
from rackhand.services.planner.control.route_check import OVERLAP
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import STANDSTILL, wrap
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.planning.corridor import Corridor
from rackhand.services.planner.planning.plan import SPACING, Target
from rackhand.services.planner.planning.worker import PlanRequest
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]
# m of the tolerance left for the path tracker, of which 13 mm were seen on detours, and for the localised pose, whose
# noise is 10 mm (1 sigma). The true pose may be off by more than that for a moment, and then so much beyond the
# tolerance; more room here would close the way round a crate of half a metre with a tolerance of 0.6 m.
TRACKING = 0.013 + 0.010
CLEAR_RUN = 0.5  # m of free line behind an obstacle, from which on it counts as passed
LONGEST_OBSTACLE = 8.0  # m of line in which that is looked for
REJOIN = (1.0, 1.5, 0.6, 2.0)  # m of line behind the obstacle at which the detour ends, tried in turn
BACK, BACK_YAW = 0.04, 0.25  # m and rad off the line, within which the chassis is back on it
DETOUR_VELOCITY = 0.4  # m/s
SAME_OBSTACLE = 0.5  # m between what blocks the line and what moved lately, to take them for the same


class Detour:
    """``route`` is the way round, None while the line is followed. ``plans`` counts the ways taken."""

    def __init__(self, tolerance: float) -> None:
        """``tolerance``: metres that the chassis' origin may be off the line; up to ``TRACKING`` of it is none."""
        self._width = tolerance - TRACKING
        self.route: Route | None = None
        self.plans = 0
        self._clear = self._rejoin = 0  # rows of the line: free again, and the end of the detour
        self._asked = (0, 0)  # the same for the plan that is asked for
        self._attempts = 0
        self._requested_at: int | None = None
        self._blocked_since: int | None = None

    def twist(self, ctx: Context, line: GivenLine, blocked: int | None) -> Twist2 | None:
        """The twist that goes round; None while the line is to be followed. ``blocked``: the row of the line ahead at
        which it is blocked. Raises ``MoveFailed(PLANNING_TIMEOUT)``."""
        if self._width <= 0.0:
            return None
        self._take_answer(ctx)
        if self.route is not None and not self._is_back(ctx, line):
            return self._drive(ctx, line, self.route, blocked)
        if blocked is None:
            self._forget(ctx)
        else:
            self._wait(ctx, line, blocked)
        return None

    def resume(self, ctx: Context, pushed: float) -> None:
        """After a hold: patience counts from now, and a chassis that is ``pushed`` metres off its detour ends it."""
        self._blocked_since = None
        if self.route is not None:
            self.route.current.update(ctx.pose)
            if self.route.current.deviation > pushed:
                self.route = None

    def ahead(self, line: GivenLine) -> Array:
        """Rows x, y, yaw of the way round and of the line after it."""
        return line.ahead() if self.route is None else np.vstack([self.route.ahead(), line.rows[self._rejoin :]])

    def left(self, line: GivenLine, pose: Array) -> float:
        """Metres to the end of the line."""
        if self.route is None:
            return line.left(pose)
        rest = line.rows[self._rejoin :, :2]
        return self.route.left(pose) + float(np.hypot(*np.diff(rest, axis=0).T).sum())

    # -- planning ----------------------------------------------------------------------------------------------------

    def _forget(self, ctx: Context) -> None:
        if self._blocked_since is not None:
            ctx.plans.cancel()
            self._blocked_since, self._attempts = None, 0

    def _wait(self, ctx: Context, line: GivenLine, blocked: int) -> None:
        """What walked into the line may walk on, and is given a moment; then a way round is looked for again and
        again."""
        if self._blocked_since is None:
            self._blocked_since = ctx.stamp
        waited = (ctx.stamp - self._blocked_since) / NANOSECONDS
        place = line.rows[blocked, :2]
        if waited > ctx.settings.planning_timeout:
            raise MoveFailed(
                MoveFailReason.PLANNING_TIMEOUT,
                f"the route is blocked at ({place[0]:.2f}, {place[1]:.2f}), no way round for {waited:.0f} s within "
                f"detour_tolerance {self._width + TRACKING:.2f} m",
            )
        moved = ctx.costmap.movers.moved_near(place, SAME_OBSTACLE, ctx.stamp)
        if not moved or waited >= ctx.settings.blocked_patience:
            self._request(ctx, line, blocked)

    def _request(self, ctx: Context, line: GivenLine, blocked: int) -> None:
        """Ask for a way from here to the line behind the obstacle, in the part of the corridor between."""
        due = self._requested_at is None or ctx.stamp - self._requested_at >= ctx.settings.replan_period * NANOSECONDS
        if ctx.plans.pending is not None or not due:
            return
        self._requested_at = ctx.stamp
        clear = behind(line.rows, blocked, ctx.costmap, ctx.footprint)
        if clear < 0:
            return
        ahead = REJOIN[self._attempts % len(REJOIN)]
        self._attempts += 1
        rejoin = min(clear + round(ahead / SPACING), len(line.rows) - 1)
        self._asked = clear, rejoin
        x, y, yaw = (float(value) for value in line.rows[rejoin])
        first = max(line.row - round(1.0 / SPACING), 0)
        corridor = Corridor(line.rows[first : rejoin + 1, :2], self._width)
        ctx.request_plan(PlanRequest(ctx.pose.copy(), Target(x, y, yaw), corridor=corridor))

    def _take_answer(self, ctx: Context) -> None:
        answer = ctx.plans.collect()
        if answer is None or answer.plan is None:
            return
        route = Route(answer.plan)
        route.current.update(ctx.pose)
        if route.current.deviation <= ctx.settings.off_path_distance:
            self.route, self._blocked_since, self._attempts = route, None, 0
            self._clear, self._rejoin = self._asked
            self.plans += 1

    # -- driving -----------------------------------------------------------------------------------------------------

    def _drive(self, ctx: Context, line: GivenLine, route: Route, blocked: int | None) -> Twist2:
        route.current.update(ctx.pose)
        free, _ = route.free_distance(ctx.costmap, ctx.footprint, ctx.settings.path_check_distance)
        if math.isfinite(free):
            self._wait(ctx, line, line.row if blocked is None else blocked)
        else:
            self._blocked_since = None
        if driving.has_ended(route, ctx.pose, driving.SEGMENT_END):
            return self._end_of_segment(ctx, line, route)
        if must_wait(ctx.pose, ctx.twist, route.ahead(), ctx.costmap.movers.rows(), ctx.footprint):
            return STANDSTILL
        return driving.follow(
            route, ctx.predicted, ctx.twist, free, ctx.costmap, ctx.footprint, closely(ctx.settings), in_place=False
        )

    def _is_back(self, ctx: Context, line: GivenLine) -> bool:
        """Whether the chassis is on the line again behind the obstacle, and goes on along it from there."""
        rows = line.rows[self._clear : self._rejoin + 1]
        away = np.hypot(rows[:, 0] - ctx.pose[0], rows[:, 1] - ctx.pose[1])
        nearest = int(away.argmin())
        if away[nearest] > BACK or abs(wrap(ctx.pose[2] - rows[nearest, 2])) > BACK_YAW:
            return False
        self._rejoin_at(ctx, line, self._clear + nearest)
        line.current.tracker.aligned = True
        return True

    def _end_of_segment(self, ctx: Context, line: GivenLine, route: Route) -> Twist2:
        if is_still(ctx.twist):
            if route.is_last:
                self._rejoin_at(ctx, line, self._rejoin)
            else:
                route.advance()
        return STANDSTILL

    def _rejoin_at(self, ctx: Context, line: GivenLine, row: int) -> None:
        ctx.plans.cancel()
        line.seek(row)
        line.update(ctx.pose)
        self.route = None


def closely(s: NavigationSettings) -> NavigationSettings:
    """Slow, and with a short look-ahead: a far look-ahead point cuts bends, which the tolerance has no room for."""
    control = s.control._replace(max_forward_velocity=min(s.control.max_forward_velocity, DETOUR_VELOCITY))
    return replace(s, control=control, max_lookahead=s.min_lookahead)


def behind(rows: Array, blocked: int, costmap: LocalCostmap, footprint: Footprint) -> int:
    """The first of the rows x, y, yaw from ``blocked`` on from which the line is free for ``CLEAR_RUN`` (or to its
    end); -1 for none within ``LONGEST_OBSTACLE``. Beyond what is near the chassis only the map's obstacles are known.
    """
    near, margin = costmap.near, costmap.settings.path_margin
    run = round(CLEAR_RUN / SPACING)
    edge = footprint.circumscribed + 2.0 * near.geometry.resolution
    free_rows = 0
    last = min(blocked + round(LONGEST_OBSTACLE / SPACING), len(rows) - 1)
    for k in range(blocked, last + 1):
        x, y, _ = rows[k]
        g = near.geometry
        right, top = g.x + g.columns * g.resolution - edge, g.y + g.rows * g.resolution - edge
        inside = g.x + edge < x < right and g.y + edge < y < top
        grid, need = (near, margin) if inside else (costmap.mapped, -OVERLAP * near.geometry.resolution)
        if grid.clearance(footprint, rows[k], margin) < need:
            free_rows = 0
            continue
        free_rows += 1
        if free_rows > run or k == len(rows) - 1:
            return k - free_rows + 1
    return -1
