"""A given route first, where the request has one, then what the move is for. ``standard`` moves are a drive to a pose
after it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.along_given_route import AlongRoute
from rackhand.services.planner.behaviors.base import Behavior, Context, Done, Drive, Status
from rackhand.services.planner.behaviors.drive_to_pose import DriveToPose, goal_of
from rackhand.services.planner.behaviors.undock import StaysDocked
from rackhand.services.planner.load import LoadState
from rackhand.services.planner.planning.given_route import parse_route
from rackhand.services.planner.planning.goals import Goal, check_goal
from rackhand.services.planner.planning.plan import Target

Check = Callable[[Context], None]


def for_request(request: MoveCreate) -> Behavior:
    """A ``standard`` move. Raises ``MoveFailed(INVALID_TRACK_POINTS)``."""
    return approach(goal_of(request), request)


def approach(goal: Goal, request: MoveCreate) -> Behavior:
    """Drive to ``goal``: straight there, or after the request's route. Fails as ``along_given_route`` and ``standard``
    moves do.

    Raises ``MoveFailed(INVALID_TRACK_POINTS)``.
    """

    def check(ctx: Context) -> None:
        if goal.x is not None and goal.y is not None:
            check_goal(ctx.costmap, ctx.footprint, Target(goal.x, goal.y, goal.yaw), ctx.settings)

    return route_first(request, DriveToPose(goal), check)


def route_first(request: MoveCreate, then: Behavior, check: Check) -> Behavior:
    """``then``, after the request's ``route_coordinates``, which are driven within its ``detour_tolerance``.

    ``check`` raises ``MoveFailed`` before a wheel turns for what would fail ``then`` at its beginning. Raises
    ``MoveFailed(INVALID_TRACK_POINTS)``.
    """
    if not request.route_coordinates:
        return then
    return RouteFirst(AlongRoute(parse_route(request.route_coordinates), request.detour_tolerance or 0.0), then, check)


class RouteFirst:
    """A given route, then another behaviour. Where that begins without undocking, the chassis is at its goal already,
    and the route is left out."""

    def __init__(self, route: AlongRoute, then: Behavior, check: Check) -> None:
        self._route, self._then, self._check = route, then, check
        self._begun = False
        self._passed = 0
        self._current: Behavior = route

    def step(self, ctx: Context) -> Drive | Done:
        if not self._begun:
            self._check(ctx)
            self._begun = True
            if ctx.load.state in (LoadState.UNDER_RACK, LoadState.DOCKED):
                self._current = self._then
        outcome = self._current.step(ctx)
        if isinstance(outcome, Drive) or self._current is not self._route:
            return outcome
        self._passed = self._route.status().passed_points
        self._current = self._then
        return self._current.step(ctx)

    def stays_docked(self, ctx: Context) -> bool:
        """As the behaviour after the route."""
        return isinstance(self._then, StaysDocked) and self._then.stays_docked(ctx)

    def resume(self, ctx: Context) -> None:
        self._current.resume(ctx)

    def status(self) -> Status:
        """Of what is driven now; on the route, the target is the requested one."""
        status = self._current.status()
        if self._current is self._route:
            return dataclasses.replace(status, target=None)
        return dataclasses.replace(status, passed_points=self._passed)
