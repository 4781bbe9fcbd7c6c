"""Keeps a route to one target: requests plans, and requests new ones when the route is blocked, left or poor."""

from __future__ import annotations

import math

import numpy as np

from rackhand.schemas.base import NANOSECONDS, Pose2
from rackhand.schemas.explain import Evidence, Measure
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.behaviors.base import Array, Context
from rackhand.services.planner.control.route import Route
from rackhand.services.planner.errors import MoveFailed, elapsed
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.perception.things import thing_at
from rackhand.services.planner.planning.plan import NoPathFound, Target
from rackhand.services.planner.planning.worker import PlanRequest

SAME_OBSTACLE = 0.5  # m between what blocks the route and what moved lately, to take them for the same
PUSHED = 0.1  # m off the route after a hold, from which on it is replanned
WORTH_IMPROVING = 1.5  # m of route left, below which no better one is looked for
RECENTLY = 5.0  # s before there was no path: what was seen since is not doubted
PLAN_ON = 20.0  # m of planned route left, before a rough guide, from which on the next part is planned
_REASONS = {
    "disconnected": MoveFailReason.CALCULATION_FAILED,
    "footprint": MoveFailReason.NO_GLOBAL_PATH,
    "budget": MoveFailReason.CALCULATION_TIMEOUT,
}


class PlanKeeper:
    """``route`` is the one to follow, None before the first plan. ``free``: metres of it ahead without an obstacle.

    A blocked, left or improvable route is followed on until the worker has another one. Where what was observed closes
    every path, what was not seen lately may have been taken away: the route then leads through it, the chassis looks at
    it from near, and it is there again as soon as it is seen. So each place is looked at once before there is no path.
    """

    def __init__(self, target: Target) -> None:
        self._target = target
        self.route: Route | None = None
        self.free = math.inf
        self.plans = 0
        self._requested_at = 0
        self._better_than = math.inf
        self._blocked_since: int | None = None
        self._blocked_at: Array = np.zeros(2)
        self._no_path: NoPathFound | None = None
        self._failed = False
        self._no_path_since: int | None = None
        self._doubt_before: int | None = None
        self._made_room = False
        self._is_doubtful = False  # the route leads through what was observed
        self._path_on_static_map = False

    @property
    def is_blocked(self) -> bool:
        """Whether an observed obstacle is on the route ahead."""
        return self._blocked_since is not None

    def without_path(self, stamp: int) -> float:
        """Seconds since there is no path; 0 while there is one, or while the chassis drives to see whether there is."""
        drives = self.route is not None and not self.is_blocked
        return 0.0 if self._no_path_since is None or drives else (stamp - self._no_path_since) / NANOSECONDS

    @property
    def lacks_room_to_turn(self) -> bool:
        """Whether there is a path for the inscribed circle, and none for the footprint."""
        return self._no_path is not None and self._no_path.kind == "footprint"

    def request(
        self,
        ctx: Context,
        *,
        better_than: float = math.inf,
        tight: bool = False,
        static_only: bool = False,
        seen_within: float = math.inf,
    ) -> None:
        """Ask for a plan from here. It replaces the route if it is shorter than ``better_than`` metres.

        ``seen_within``: seconds; through obstacles that were not seen since.
        """
        self._requested_at, self._better_than = ctx.stamp, better_than
        ctx.request_plan(
            PlanRequest(
                ctx.pose.copy(), self._target, static_only, tight,
                seen_within=seen_within, by_cell=self._made_room,
            )
        )  # fmt: skip

    def take_no_path(self) -> bool:
        """Whether there is no path to what was aimed at; once for each answer of the planner."""
        failed, self._failed = self._failed, False
        return failed

    def aim(self, target: Target) -> None:
        """Plan to another place from the next request on."""
        self._target = target

    def discard(self, ctx: Context, *, tight: bool = False, made_room: bool = False) -> None:
        """The route's end was not the goal, or it cannot be driven: replan, and stop until then.

        ``made_room``: somebody who came after the chassis hides where they were, and that is doubted.
        """
        self.route, self.free, self._blocked_since = None, math.inf, None
        if made_room:
            self._made_room, self._doubt_before = True, None
        self.request(ctx, tight=tight)

    def resume(self, ctx: Context) -> None:
        """After a hold: what blocked before counts from now, and a chassis that was pushed off its route gets one from
        where it is."""
        self._blocked_since = self._no_path_since = None
        if self.route is not None:
            self.route.current.update(ctx.pose)
            if self.route.current.deviation > PUSHED:
                self.discard(ctx)

    def update(self, ctx: Context, stuck: bool) -> bool:
        """One tick. True if a new route was taken. ``stuck``: no progress though nothing blocks the route.

        Raises ``MoveFailed`` when there is no path, or has been none for too long.
        """
        taken = self._take_answer(ctx)
        if self.route is not None:
            self._watch(ctx, self.route)
        if ctx.plans.pending is None:
            self._request_if_needed(ctx, stuck)
        if self.route is not None and not self.is_blocked and not stuck and not self._is_doubtful:
            self._no_path_since = None  # it is driven along: what was looked for is another one
        self._check_patience(ctx)
        return taken

    def _take_answer(self, ctx: Context) -> bool:
        answer = ctx.plans.collect()
        if answer is None:
            return False
        if answer.no_path is not None:
            self._note_no_path(ctx, answer.request, answer.no_path)
            return False
        if answer.request.static_only:
            self._path_on_static_map = True
            return False
        if not _doubts(answer.request):
            self._no_path = self._no_path_since = self._doubt_before = None
            self._is_doubtful = self._made_room = False
        plan = answer.plan
        if plan is None or plan.length >= self._better_than:
            return False
        route = Route(plan)
        if not _begins_here(route, ctx):
            return False
        self.route, self._blocked_since = route, None
        self._is_doubtful = _doubts(answer.request)
        self.plans += 1
        return True

    def _note_no_path(self, ctx: Context, request: PlanRequest, no_path: NoPathFound) -> None:
        if request.static_only:
            raise MoveFailed(_REASONS[no_path.kind], no_path.text, narrow_place(ctx.costmap, no_path))
        if _doubts(request):
            self._failed = True
            return
        self._no_path = no_path
        if self._no_path_since is None:
            self._no_path_since = ctx.stamp
        if self._doubt_before is None:
            self._doubt_before = ctx.stamp - round(RECENTLY * NANOSECONDS)
        if not self.plans and not self._path_on_static_map:  # the map alone shows whether waiting can help
            self._failed = True
            self.request(ctx, static_only=True)
        else:
            within = (ctx.stamp - self._doubt_before) / NANOSECONDS
            self.request(ctx, better_than=self._better_than, tight=request.tight, seen_within=within)

    def _watch(self, ctx: Context, route: Route) -> None:
        """Where on the route the chassis is, and whether it is free ahead."""
        route.current.update(ctx.pose)
        self.free, self._blocked_at = route.free_distance(ctx.costmap, ctx.footprint, ctx.settings.path_check_distance)
        if math.isinf(self.free):
            if self._blocked_since is not None and not self._is_doubtful:
                self._no_path_since = None  # it is free again: no other path is needed
            self._blocked_since = None
        elif self._blocked_since is None:
            self._blocked_since = ctx.stamp

    def _request_if_needed(self, ctx: Context, stuck: bool) -> None:
        s = ctx.settings
        since = (ctx.stamp - self._requested_at) / NANOSECONDS
        if self.route is None:
            if since >= s.replan_period:
                self.request(ctx)
            return
        left = self.route.left(ctx.pose)
        must_go_round = self._must_go_round(ctx)
        lost = self.route.current.deviation > s.off_path_distance
        unplanned = self.route.planned(ctx.pose) < PLAN_ON and since >= s.improve_period
        if unplanned or ((must_go_round or lost) and since >= s.replan_period):
            self.request(ctx)
        elif stuck and not must_go_round and since >= s.improve_period:
            self.request(ctx, tight=True)
        elif since >= s.improve_period and left > WORTH_IMPROVING:
            self.request(ctx, better_than=s.improve_ratio * left)

    def _must_go_round(self, ctx: Context) -> bool:
        """Whether the route is blocked for good: what walked into it may walk on, and is given a moment."""
        if self._blocked_since is None:
            return False
        if not ctx.costmap.movers.moved_near(self._blocked_at, SAME_OBSTACLE, ctx.stamp):
            return True
        return (ctx.stamp - self._blocked_since) / NANOSECONDS >= ctx.settings.blocked_patience

    def _check_patience(self, ctx: Context) -> None:
        waited = self.without_path(ctx.stamp)
        if waited > ctx.settings.planning_timeout:
            raise MoveFailed(
                MoveFailReason.PLANNING_TIMEOUT,
                f"no path found for {waited:.0f} s, observed obstacles block every one ({self._no_path})",
                _waited_for_path(ctx, waited, self._no_path),
            )


def _doubts(request: PlanRequest) -> bool:
    return math.isfinite(request.seen_within)


def _begins_here(route: Route, ctx: Context) -> bool:
    """Whether the chassis, which may have driven on while this was planned, is still on it."""
    route.current.update(ctx.pose)
    return route.current.deviation <= ctx.settings.off_path_distance


def narrow_place(costmap: LocalCostmap, no_path: NoPathFound) -> Evidence:
    """The tightest place of the widest way, and what stands there; of a search that was cut short, how far it came."""
    tight = no_path.bottleneck
    if no_path.kind == "budget":
        tried = Measure(name="places that were tried", value=no_path.tried, setting="planning.search_limit")
        return Evidence(measures=(tried,))
    if tight is None:
        return Evidence()
    thing = thing_at(costmap, tight.blocked_x, tight.blocked_y)
    middle = Pose2(x=tight.x, y=tight.y, yaw=0.0)
    radius, needed = round(tight.radius, 3), round(no_path.needed, 3)
    thing = thing.model_copy(update={"clearance": radius, "needed": needed, "at": middle})
    what = "inscribed" if no_path.kind == "disconnected" else "circumscribed"
    room = Measure(name=f"room for the {what} circle", value=radius, expected=needed, unit="m")
    return Evidence(things=(thing,), measures=(room,))


def _waited_for_path(ctx: Context, waited: float, no_path: NoPathFound | None) -> Evidence:
    found = Evidence() if no_path is None else narrow_place(ctx.costmap, no_path)
    limit = ctx.settings.planning_timeout
    measure = elapsed("time without a path", waited, limit)
    return found.model_copy(update={"measures": (measure, *found.measures)})


def ahead_of(route: Route | None, pose: Pose) -> Array:
    """The path ahead, rows x, y, yaw; the pose alone without a route."""
    return pose[None] if route is None else route.ahead()
