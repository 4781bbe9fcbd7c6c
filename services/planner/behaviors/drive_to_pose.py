"""``standard``: drive to a pose in the map around what is in the way, then turn to its heading.

Why such a move fails, and when:

==== ========================== =======================================================================================
  #  reason                     raised
==== ========================== =======================================================================================
  3  starting_point_out_of_map  at start: the chassis' origin is outside the grid
  4  ending_point_out_of_map    at start: the goal is outside the grid
  5  starting_point_not_in_     at start: the origin's cell is not traversable (built, unknown, virtual wall, no-go
     ground                     region), or the footprint overlaps such cells by more than 5 cm
  6  ending_point_not_in_       at start: the goal's cell is not traversable, or the inscribed circle overlaps such
     ground                     cells there, or, where the goal has a heading, the footprint at the goal pose does
  7  starting_equal_ending      at start: ``inplace_rotate`` without a heading, to where the chassis is already. Any
                                other goal where the chassis is already succeeds at once
  9  calculation_failed         on map and overlays the inscribed circle has no path from start to goal
 10  calculation_timeout        a search expanded ``max_expansions`` cells or states without an answer
 11  no_global_path             on map and overlays the circle has a path, the footprint none
 14  planning_timeout           observed obstacles have blocked every path for ``planning_timeout``
 15  move_timeout               there is a path, but no progress on it for ``move_timeout``: an obstacle blocks it, or
                                the chassis does not follow velocity commands; or the move goes to and fro for longer
                                than its path takes at 0.1 m/s
 18  rotate_timeout             a turn to the goal's heading comes no nearer to it for ``rotate_timeout``
==== ========================== =======================================================================================

3 to 7, and 9 to 11 for the map alone, come before a wheel turns.
"""

from __future__ import annotations

import numpy as np

from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.base import Context, Done, Drive, Status
from rackhand.services.planner.behaviors.plan_keeper import PlanKeeper, ahead_of
from rackhand.services.planner.control import driving
from rackhand.services.planner.control.goal_checker import GoalChecker, is_still
from rackhand.services.planner.control.mppi import CostField
from rackhand.services.planner.control.progress_checker import Phase, ProgressWatch
from rackhand.services.planner.control.recovery import OUT_OF_WAY, Recovery
from rackhand.services.planner.control.route import Route
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import STANDSTILL, wrap
from rackhand.services.planner.planning.goals import RINGS, Goal, check_goal, check_start, zone_target
from rackhand.services.planner.planning.plan import NOWHERE

STAND_OFF = 5.0  # s without a path, after which the chassis makes room for who may wait for that
FACING = 1.0  # m between its origin and who does, beyond their radius
BOXED_IN = 0.1  # m of clearance, below which the first step of a search, from cell to cell, may find no room
NO_FIELD = CostField(np.empty((0, 0), dtype=np.float32), NOWHERE)


def goal_of(request: MoveCreate) -> Goal:
    """The goal of a ``standard`` move."""
    return Goal(
        x=request.target_x,
        y=request.target_y,
        yaw=request.target_ori,
        accuracy=request.target_accuracy or Goal.accuracy,  # clients send 0 for "as usual"
        zone=bool(request.use_target_zone),
        rotate_in_place=request.properties.get("inplace_rotate") is True,
    )


class DriveToPose:
    """Stages: ``planning`` until the first plan, ``driving``, ``rotating`` at the goal, ``done``."""

    _checker: GoalChecker
    _keeper: PlanKeeper
    _progress: ProgressWatch
    _recovery: Recovery

    def __init__(self, goal: Goal) -> None:
        self._goal = goal
        self._begun = False
        self._ring = 0
        self._stage: Phase = "planning"
        self._status = Status()

    def _begin(self, ctx: Context) -> None:
        self._checker = GoalChecker(self._goal, ctx.pose, ctx.settings)
        self._check(ctx)
        self._keeper = PlanKeeper(self._checker.target)
        self._progress = ProgressWatch(ctx.settings, ctx.stamp)
        self._recovery = Recovery()
        self._begun = True
        ctx.avoidance.begin()
        if self._checker.is_there(ctx.pose):
            self._stage = "done"
        elif self._checker.turn_only:
            self._stage = "rotating"
        else:
            self._keeper.request(ctx)

    def _check(self, ctx: Context) -> None:
        goal, target = self._goal, self._checker.target
        check_start(ctx.costmap, ctx.footprint, ctx.pose)
        if not self._checker.turn_only and not self._is_zone_with_room(ctx):
            check_goal(ctx.costmap, ctx.footprint, target, ctx.settings)
        if goal.rotate_in_place and goal.yaw is None and self._checker.is_there(ctx.pose):
            raise MoveFailed(
                MoveFailReason.STARTING_EQUAL_ENDING,
                f"inplace_rotate without target_ori, and the chassis is already within {goal.accuracy} m of the goal "
                f"({target.x:.3f}, {target.y:.3f}): no rotation to make",
            )

    def _is_zone_with_room(self, ctx: Context) -> bool:
        zone = self._goal.zone and not self._checker.turn_only
        return zone and zone_target(ctx.costmap, ctx.footprint, self._goal, ctx.pose) is not None

    def _aim(self, ctx: Context) -> None:
        """In a zone whose middle is occupied: at a free place in it; farther out where there is no path to that, as to
        a place inside an obstacle of which only the front is seen."""
        if self._goal.zone and (self._keeper.route is None or self._keeper.is_blocked):
            if self._keeper.take_no_path():
                self._ring = (self._ring + 1) % (RINGS + 1)
            target = zone_target(ctx.costmap, ctx.footprint, self._goal, ctx.pose, self._ring)
            if target is not None:
                self._keeper.aim(target)

    def _target_pose(self) -> Pose2:
        target = self._checker.target
        return Pose2(x=target.x, y=target.y, yaw=target.yaw or 0.0)

    # -- stages ------------------------------------------------------------------------------------------------------

    def step(self, ctx: Context) -> Drive | Done:
        if not self._begun:
            self._begin(ctx)
        if self._checker.is_in_zone(ctx.pose):
            self._stage = "done"
        if self._stage in ("planning", "driving"):
            self._keep_route(ctx)
        wanted = self._steer(ctx)
        self._measure_progress(ctx)
        self._status = self._measured(ctx)
        return Done() if self._stage == "done" else Drive(wanted)

    def resume(self, ctx: Context) -> None:
        if not self._begun:
            return
        self._progress.restart(ctx.stamp)
        self._recovery.restart()
        if self._stage in ("planning", "driving"):
            self._keeper.resume(ctx)

    def status(self) -> Status:
        return self._status

    def standing(self, stamp: int) -> float:
        """Seconds without progress; 0 before the first step."""
        return self._progress.standing(stamp) if self._begun else 0.0

    def _keep_route(self, ctx: Context) -> None:
        self._aim(ctx)
        stuck = self._progress.standing(ctx.stamp) > ctx.settings.stuck_after
        if self._keeper.update(ctx, stuck):
            self._progress.renew()
        self._stage = "planning" if self._keeper.route is None else "driving"

    def _steer(self, ctx: Context) -> Twist2:
        """The twist wanted in this stage; goes on to the next stage where one ends."""
        if self._must_give_way(ctx):
            return self._give_way(ctx)
        if self._stage in ("planning", "driving"):
            self._recovery.watch(ctx.stamp, ctx.twist, ctx.vetoed)
            if self._recovery.runs or self._makes_room(ctx):
                return self._recover(ctx)
        if self._stage == "driving" and self._keeper.route is not None:
            return self._drive(ctx, self._keeper.route)
        if self._stage == "rotating":
            return self._rotate(ctx)
        return STANDSTILL

    def _drive(self, ctx: Context, route: Route) -> Twist2:
        if self._recovery.is_held(ctx.stamp) and self._checker.has_position(ctx.pose):
            self._recovery.restart()
            self._arrive(ctx)  # as near as it gets, and near enough
            return STANDSTILL
        if self._recovery.is_held(ctx.stamp) and self._recovery.begin(ctx.stamp, ctx.pose, ctx.costmap, ctx.footprint):
            return self._recover(ctx)
        stop_within = self._checker.stop_within if route.is_last else driving.SEGMENT_END
        if not driving.has_ended(route, ctx.pose, stop_within):
            return driving.follow(
                route, ctx.predicted, ctx.twist, self._keeper.free, ctx.costmap, ctx.footprint, ctx.settings,
                self._goal.rotate_in_place,
            )  # fmt: skip
        if not is_still(ctx.twist):
            return STANDSTILL
        if not route.is_last:
            route.advance()
            return STANDSTILL
        self._arrive(ctx)
        return self._rotate(ctx) if self._stage == "rotating" else STANDSTILL

    def _makes_room(self, ctx: Context) -> bool:
        """Whether the chassis backs away from now on: it has no path, and somebody who came lately is close to it, or
        something is so close beside it that it cannot turn out. People and vehicles on the goal or on the way to it may
        be waiting for the chassis to move, and it for them."""
        if self._keeper.without_path(ctx.stamp) < STAND_OFF or self._checker.turn_only or not is_still(ctx.twist):
            return False
        if not ctx.costmap.movers.moved_near(ctx.pose[:2], FACING, ctx.stamp) and not self._is_boxed_in(ctx):
            return False
        return self._recovery.begin(ctx.stamp, ctx.pose, ctx.costmap, ctx.footprint, OUT_OF_WAY)

    def _is_boxed_in(self, ctx: Context) -> bool:
        if not self._keeper.lacks_room_to_turn:
            return False
        return bool(ctx.costmap.near.clearance(ctx.footprint, ctx.pose, BOXED_IN) < BOXED_IN)

    def _recover(self, ctx: Context) -> Twist2:
        wanted = self._recovery.command(ctx.stamp, ctx.pose, ctx.vetoed)
        if wanted is None:
            self._keeper.discard(ctx, tight=True, made_room=self._keeper.without_path(ctx.stamp) > 0.0)
            return STANDSTILL
        return wanted

    def _rotate(self, ctx: Context) -> Twist2:
        if self._checker.was_pushed_aside(ctx.pose):
            self._arrive(ctx)
            return STANDSTILL
        if not self._checker.has_heading(ctx.pose):
            ahead = ctx.predicted
            error = self._checker.heading_error(ahead)
            return driving.turn(ahead, error, ctx.costmap, ctx.footprint, ctx.settings)
        if is_still(ctx.twist):
            self._arrive(ctx)
        return STANDSTILL

    def _arrive(self, ctx: Context) -> None:
        """At rest where driving or turning ended: done, turn, or go once more for what was missed."""
        if not self._checker.has_position(ctx.pose):
            self._stage = "planning"
            self._keeper.discard(ctx)
        elif not self._checker.has_heading(ctx.pose):
            self._stage = "rotating"
        else:
            self._stage = "done"

    # -- what moves --------------------------------------------------------------------------------------------------

    def _must_give_way(self, ctx: Context) -> bool:
        """Whether a moving obstacle will come too near. A chassis that may only turn on the spot cannot avoid it."""
        if self._stage == "done" or self._checker.turn_only or self._goal.rotate_in_place:
            return False
        path = ahead_of(self._keeper.route if self._stage == "driving" else None, ctx.pose)
        return ctx.avoidance.is_due(
            ctx.pose, path, abs(ctx.twist.linear), ctx.costmap.movers.rows(), ctx.footprint, ctx.stamp
        )

    def _give_way(self, ctx: Context) -> Twist2:
        route = self._keeper.route
        cost = NO_FIELD if route is None else CostField(route.plan.cost, route.plan.geometry)
        goal = self._checker.as_pose(ctx.pose)
        return ctx.avoidance.command(ctx.predicted, ctx.twist, ctx.commanded, ctx.costmap, cost, goal, ctx.footprint)

    # -- progress ----------------------------------------------------------------------------------------------------

    def _measure_progress(self, ctx: Context) -> None:
        route = self._keeper.route
        if self._stage == "rotating":
            self._progress.update(ctx.stamp, "turn to the goal", abs(self._checker.heading_error(ctx.pose)))
        elif self._stage == "driving" and route is not None:
            tracker = route.current
            if tracker.aligned:
                self._progress.update(ctx.stamp, "path", route.left(ctx.pose))
            else:
                error = wrap(tracker.segment.points[tracker.index][2] - ctx.pose[2])
                self._progress.update(ctx.stamp, "turn", abs(error))
        blocked = ctx.vetoed or self._keeper.is_blocked
        why = "blocked by an obstacle" if blocked else "the chassis does not follow velocity commands"
        self._progress.check(ctx.stamp, self._stage, why)

    def _measured(self, ctx: Context) -> Status:
        route = self._keeper.route if self._stage == "driving" else None
        stuck = "none" if self._stage == "done" else self._progress.stuck_state(ctx.stamp, self._stage)
        return Status(
            target=self._target_pose(),
            path=np.empty((0, 3)) if route is None else route.ahead(),
            remaining_distance=0.0 if route is None else route.left(ctx.pose),
            stuck_state=stuck,
            viewport_blocked=ctx.vetoed or self._keeper.is_blocked,
            plans=self._keeper.plans,
        )
