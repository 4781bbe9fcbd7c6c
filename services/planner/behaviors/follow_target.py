"""``follow_target``: keep ``follow_distance`` from a target that a client reports on ``/follow_target_state``.

A report may have a position, a heading, or both. The chassis drives towards the position as fast as the target, on a
path that is planned anew as the target moves, and faces it at rest; with a heading it takes that heading at rest. A
heading alone is turned to on the spot. It does not back away from a target that comes nearer. ``pause`` holds it still
until the next report, however long that takes. Without a report for ``follow_silence`` it stops. The move ends when it
is cancelled or replaced, or fails:

==== ========================== =======================================================================================
  #  reason                     raised
==== ========================== =======================================================================================
3, 5 starting_point_…           at start, as for ``standard`` moves
 15  move_timeout               nothing is in the way, but no motion for ``move_timeout``: the chassis does not follow
                                velocity commands
600  follow_failed              a report says ``fail``; no report for ``follow_timeout``; or no path to the target, or
                                no motion towards it, for ``planning_timeout``
==== ========================== =======================================================================================
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import NANOSECONDS, Pose2, Twist2
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.base import Behavior, Context, Drive, Status
from rackhand.services.planner.control import driving
from rackhand.services.planner.control.following import (
    TargetEstimate,
    bearing_error,
    following_speed,
    limited_to,
    place_to_drive_to,
)
from rackhand.services.planner.control.given_line import must_wait
from rackhand.services.planner.control.route import Route
from rackhand.services.planner.errors import MoveFailed, elapsed
from rackhand.services.planner.geometry.se2 import STANDSTILL, wrap
from rackhand.services.planner.perception.chassis_state import Followed
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.planning.goals import check_start
from rackhand.services.planner.planning.plan import Target
from rackhand.services.planner.planning.worker import PlanRequest

Array = NDArray[np.float64]
MOVED = 0.1  # m of motion of the target, after which the path is planned anew
KEPT_DISTANCE = 0.1  # m beyond the wanted distance, within which the chassis stays and turns only
FACING = 0.3  # rad off the target, from which on the chassis turns to it at rest
BARELY_MOVING = 0.03  # m/s and rad/s
OLD_PATH = 2.0  # s that the last path is followed on while there is no newer one
STRAIGHT = 1.02  # length of a path that counts as straight, in distances from its start to its end
OCTAGON = np.column_stack([np.cos(np.arange(8) * math.pi / 4), np.sin(np.arange(8) * math.pi / 4)])


def for_request(_request: MoveCreate) -> Behavior:
    return FollowTarget()


class FollowTarget:
    """``_heard`` is the stamp from which silence counts, ``_advanced`` that from which standing still counts."""

    def __init__(self) -> None:
        self._estimate = TargetEstimate()
        self._route: Route | None = None
        self._place: Array | None = None  # the end of the route that was asked for last
        self._requested_at = self._heard = self._advanced = self._planned_at = 0
        self._no_path = ""
        self._free = math.inf  # metres of path ahead without an obstacle
        self._plans = 0
        self._turning = False
        self._begun = False
        self._status = Status()

    # -- interface ---------------------------------------------------------------------------------------------------

    def step(self, ctx: Context) -> Drive:
        if not self._begun:
            check_start(ctx.costmap, ctx.footprint, ctx.pose)
            self._restart(ctx)
            self._begun = True
        followed = ctx.state.followed
        wanted = STANDSTILL if followed is None else self._follow(ctx, followed)
        self._check_silence(ctx, followed)
        return Drive(wanted)

    def resume(self, ctx: Context) -> None:
        if self._begun:
            self._restart(ctx)
            self._route = None

    def status(self) -> Status:
        return self._status

    def _restart(self, ctx: Context) -> None:
        """Silence and standing still count from now."""
        self._heard = self._advanced = self._planned_at = ctx.stamp

    # -- the target --------------------------------------------------------------------------------------------------

    def _follow(self, ctx: Context, followed: Followed) -> Twist2:
        target = followed.target
        self._heard = max(self._heard, followed.stamp)
        if target.state == "fail":
            raise MoveFailed(MoveFailReason.FOLLOW_FAILED, "the client reported follow_state 'fail'")
        if target.state == "pause" or self._silence(ctx) > ctx.settings.follow_silence:
            self._advanced = self._planned_at = ctx.stamp
            self._status = Status(target=self._status.target, plans=self._plans)
            return STANDSTILL
        self._estimate.take(followed)
        place = None if target.position is None else self._estimate.at(ctx.stamp)
        if place is not None:
            return self._after(ctx, place, target.yaw)
        self._route, self._advanced = None, ctx.stamp
        self._status = Status(plans=self._plans)
        return self._turn(ctx, 0.0 if target.yaw is None else wrap(target.yaw - ctx.pose[2]), driving.ALIGNED)

    def _silence(self, ctx: Context) -> float:
        return (ctx.stamp - self._heard) / NANOSECONDS

    def _check_silence(self, ctx: Context, followed: Followed | None) -> None:
        paused = followed is not None and followed.target.state == "pause"
        if not paused and self._silence(ctx) > ctx.settings.follow_timeout:
            silence, most = self._silence(ctx), ctx.settings.follow_timeout
            text = f"no /follow_target_state for {silence:.0f} s, expected 2 to 4 a second"
            silent = elapsed("time without /follow_target_state", silence, most)
            raise MoveFailed(MoveFailReason.FOLLOW_FAILED, text).about(measures=(silent,))

    # -- driving -----------------------------------------------------------------------------------------------------

    def _after(self, ctx: Context, target: Array, yaw: float | None) -> Twist2:
        """The twist after a target at a position."""
        self._plan(ctx, target)
        left = self._left(ctx, target)
        costmap = self._without_target(ctx.costmap, target, ctx.settings.target_radius)
        if left <= ctx.settings.follow_distance + KEPT_DISTANCE and self._estimate.is_at_rest:
            wanted = self._stay(ctx, target, yaw)
        elif self._route is None:
            wanted = STANDSTILL
        else:
            wanted = self._drive(ctx, self._route, target, left, costmap)
        self._measure(ctx, target, yaw, left, wanted)
        return wanted

    def _stay(self, ctx: Context, target: Array, yaw: float | None) -> Twist2:
        """At the wanted distance: face the target, or take the heading that was reported."""
        self._advanced = ctx.stamp
        if yaw is not None:
            return self._turn(ctx, wrap(yaw - ctx.pose[2]), driving.ALIGNED)
        return self._turn(ctx, bearing_error(ctx.pose, target), FACING)

    def _turn(self, ctx: Context, error: float, slack: float) -> Twist2:
        """A turn on the spot that begins beyond ``slack`` rad and ends within ``ALIGNED``."""
        self._turning = abs(error) > (driving.ALIGNED if self._turning else slack)
        if not self._turning:
            return STANDSTILL
        return driving.turn(ctx.pose, error, ctx.costmap, ctx.footprint, ctx.settings)

    def _drive(self, ctx: Context, route: Route, target: Array, left: float, costmap: LocalCostmap) -> Twist2:
        s, pose = ctx.settings, ctx.pose
        self._turning = False
        ahead = route.ahead()
        movers = costmap.movers.rows()
        others = movers[np.hypot(*(movers[:, :2] - target).T) > s.target_radius + movers[:, 4]]
        if must_wait(pose, ctx.twist, ahead, others, ctx.footprint):
            return STANDSTILL
        if driving.has_ended(route, pose, driving.SEGMENT_END) and not route.is_last:
            route.advance()
            return STANDSTILL
        self._free, _ = route.free_distance(costmap, ctx.footprint, s.path_check_distance)
        twist = driving.follow(route, ctx.predicted, ctx.twist, self._free, costmap, ctx.footprint, s, in_place=False)
        direction = ahead[min(len(ahead) - 1, 10), :2] - pose[:2]
        away = float(self._estimate.velocity @ direction) / max(math.hypot(*direction), 1e-6)
        return limited_to(twist, following_speed(left, away, s))

    def _without_target(self, costmap: LocalCostmap, target: Array, radius: float) -> LocalCostmap:
        """The target is an obstacle to the braking guard, but not to the path towards it."""
        seen = costmap.near.at(target[0], target[1]) < radius
        return costmap.mask(target + radius * OCTAGON) if seen else costmap

    def _left(self, ctx: Context, target: Array) -> float:
        """Metres to the target: along the path where that goes round something, else straight."""
        straight = math.dist(target, ctx.pose[:2])
        if self._route is None or self._place is None:
            return straight
        along = self._route.left(ctx.pose)
        end = self._route.trackers[-1].end
        if along < STRAIGHT * math.dist(end[:2], ctx.pose[:2]) + 0.05:
            return straight
        return along + math.dist(end[:2], target)

    # -- planning ----------------------------------------------------------------------------------------------------

    def _plan(self, ctx: Context, target: Array) -> None:
        self._take_answer(ctx)
        if self._route is not None:
            self._route.current.update(ctx.pose)
        since = (ctx.stamp - self._requested_at) / NANOSECONDS
        if ctx.plans.pending is not None or since < ctx.settings.follow_replan_period:
            return
        place = place_to_drive_to(
            target, ctx.costmap.mapped.grid_at(*target.tolist()), ctx.footprint, ctx.settings.plan_margin
        )
        if place is None:
            self._no_path = "no place near the target is free on the map"
            return
        moved = self._place is None or math.dist(place, self._place) > MOVED
        if moved or self._route is None or self._must_leave(ctx, self._route):
            self._requested_at, self._place = ctx.stamp, place
            goal = Target(float(place[0]), float(place[1]), None)
            ctx.request_plan(PlanRequest(ctx.pose.copy(), goal, clear_around=ctx.settings.target_radius))

    def _must_leave(self, ctx: Context, route: Route) -> bool:
        """Whether the path is blocked, or the chassis off it."""
        return math.isfinite(self._free) or route.current.deviation > ctx.settings.off_path_distance

    def _take_answer(self, ctx: Context) -> None:
        answer = ctx.plans.collect()
        if answer is not None and answer.plan is not None:
            self._route = Route(answer.plan)
            self._plans, self._planned_at, self._no_path = 1, ctx.stamp, ""
            tracker = self._route.current
            tracker.update(ctx.pose)
            # A path that is replaced while driving goes on in about the same direction: no turn on the spot for it.
            error = wrap(tracker.segment.points[tracker.index][2] - ctx.pose[2])
            tracker.aligned = abs(error) < ctx.settings.rotate_first_angle
        elif answer is not None and answer.no_path is not None:
            self._no_path = answer.no_path.text
        if self._no_path and (ctx.stamp - self._planned_at) / NANOSECONDS > OLD_PATH:
            self._route = None

    # -- progress ----------------------------------------------------------------------------------------------------

    def _measure(self, ctx: Context, target: Array, yaw: float | None, left: float, wanted: Twist2) -> None:
        s = ctx.settings
        moves = max(abs(ctx.twist.linear), abs(ctx.twist.angular)) > BARELY_MOVING
        if moves or left <= s.follow_distance + KEPT_DISTANCE:
            self._advanced = ctx.stamp
        standing = (ctx.stamp - self._advanced) / NANOSECONDS
        blocked = ctx.vetoed or (wanted.linear == 0.0 and wanted.angular == 0.0)
        if standing > s.planning_timeout and blocked:
            why = self._no_path or "an obstacle is in the way"
            text = f"the target at ({target[0]:.2f}, {target[1]:.2f}) was not reached for {standing:.0f} s: {why}"
            raise MoveFailed(MoveFailReason.FOLLOW_FAILED, text)
        if standing > s.move_timeout and not blocked:
            text = f"no motion for {standing:.0f} s: the chassis does not follow velocity commands"
            raise MoveFailed(MoveFailReason.MOVE_TIMEOUT, text)
        self._status = Status(
            target=Pose2(x=float(target[0]), y=float(target[1]), yaw=yaw or 0.0),
            path=np.empty((0, 3)) if self._route is None else self._route.ahead(),
            remaining_distance=max(left - s.follow_distance, 0.0),
            stuck_state="move_stucked" if standing > s.stuck_after else "none",
            viewport_blocked=ctx.vetoed,
            plans=self._plans,
        )
