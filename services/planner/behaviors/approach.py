"""Driving to a pose, along a given route first if the request has one. ``standard`` moves are no more than that."""

from __future__ import annotations

import dataclasses

from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.along_given_route import AlongRoute
from rackhand.services.planner.behaviors.base import Behavior, Context, Done, Drive, Status
from rackhand.services.planner.behaviors.drive_to_pose import DriveToPose, goal_of
from rackhand.services.planner.planning.given_route import parse_route
from rackhand.services.planner.planning.goals import Goal, check_goal
from rackhand.services.planner.planning.plan import Target


def for_request(request: MoveCreate) -> Behavior:
    """A ``standard`` move. Raises ``MoveFailed(INVALID_TRACK_POINTS)``."""
    return approach(goal_of(request), request)


def approach(goal: Goal, request: MoveCreate) -> Behavior:
    """Drive to ``goal``: straight there, or along the request's ``route_coordinates`` within its ``detour_tolerance``
    and from the last point of the route to the goal. Fails as ``along_given_route`` and ``standard`` moves do.

    Raises ``MoveFailed(INVALID_TRACK_POINTS)``.
    """
    if not request.route_coordinates:
        return DriveToPose(goal)
    return RouteThenPose(AlongRoute(parse_route(request.route_coordinates), request.detour_tolerance or 0.0), goal)


class RouteThenPose:
    """A given route, then the drive from its end to a goal."""

    def __init__(self, route: AlongRoute, goal: Goal) -> None:
        self._route, self._goal = route, goal
        self._begun = False
        self._passed = 0
        self._current: AlongRoute | DriveToPose = route

    def step(self, ctx: Context) -> Drive | Done:
        if not self._begun:
            self._check_goal(ctx)
            self._begun = True
        outcome = self._current.step(ctx)
        if isinstance(outcome, Drive) or self._current is not self._route:
            return outcome
        self._passed = self._route.status().passed_points
        self._current = DriveToPose(self._goal)
        return self._current.step(ctx)

    def _check_goal(self, ctx: Context) -> None:
        """Before a wheel turns, as for a move without a route."""
        if self._goal.x is not None and self._goal.y is not None:
            check_goal(ctx.costmap, ctx.footprint, Target(self._goal.x, self._goal.y, self._goal.yaw), ctx.settings)

    def resume(self, ctx: Context) -> None:
        self._current.resume(ctx)

    def status(self) -> Status:
        """Of what is driven now; on the route, the target is the requested one."""
        status = self._current.status()
        if self._current is self._route:
            return dataclasses.replace(status, target=None)
        return dataclasses.replace(status, passed_points=self._passed)
