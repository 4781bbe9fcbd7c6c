"""``return_to_elevator_waiting_point``: out of a lift's doorway and to a pose before it, after a lift was not entered.

A chassis that is partly in the cabin, or nearer to it than its doors, first drives straight out, backward or forward,
whichever leads towards the target: it does not turn between doors. The rest is a ``standard`` move, and fails as one.
"""

from __future__ import annotations

import math

import numpy as np

from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.base import Behavior, Context, Done, Drive, Status
from rackhand.services.planner.behaviors.drive_to_pose import DriveToPose, goal_of
from rackhand.services.planner.behaviors.straight_out import straight_free
from rackhand.services.planner.control import docking
from rackhand.services.planner.control.progress_checker import RestWatch
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.polygon import inside_convex
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.perception.lift_view import lifts, whereabouts, with_doors

STEEPEST = math.radians(40.0)  # between the axis of the chassis and the direction of the target
SPEED = 0.3  # m/s
KEEP = 0.08  # m before an obstacle
STEP, LONGEST = 0.05, 4.0  # m of the way out that are looked at
GIVE_UP_AFTER = 3.0  # s of being blocked, after which another way is planned


def for_request(request: MoveCreate) -> Behavior:
    return ReturnToWaitingPoint(request)


class ReturnToWaitingPoint:
    """``_axis`` is the pose at which driving straight out begins, None before and where it is not needed."""

    def __init__(self, request: MoveCreate) -> None:
        self._target = None if request.target_x is None else (request.target_x, request.target_y)
        self._drive = DriveToPose(goal_of(request))
        self._axis: Pose | None = None
        self._direction = -1
        self._begun = self._out = False

    def step(self, ctx: Context) -> Drive | Done:
        if not self._begun:
            self._begin(ctx)
        left = 0.0 if self._axis is None or self._out else _way_out(ctx, self._direction)
        if left <= 0.0 or self._axis is None or self._is_stuck(ctx):
            self._out = True
            return self._drive.step(ctx)
        go = min(left, straight_free(ctx, self._direction) - KEEP)
        if go <= 0.0:
            return Drive(se2.STANDSTILL)
        at = se2.advanced(se2.between(self._axis, ctx.pose), ctx.twist, ctx.settings.actuation.latency)
        return Drive(docking.along_axis(at, self._direction, go, SPEED, ctx.settings))

    def resume(self, ctx: Context) -> None:
        if self._begun and not self._out:
            self._begin(ctx)  # it may have been pushed
        self._drive.resume(ctx)

    def status(self) -> Status:
        return self._drive.status()

    def _begin(self, ctx: Context) -> None:
        self._begun, self._axis = True, None
        self._watch = RestWatch(ctx.stamp)
        self._direction = self._towards_target(ctx)
        if self._direction and _between_doors(ctx):
            self._axis = ctx.pose.copy()

    def _towards_target(self, ctx: Context) -> int:
        """1 where the target is ahead, -1 where it is behind, 0 where it is to the side."""
        if self._target is None:
            return 0
        x, y = se2.between(ctx.pose, np.array([*self._target, 0.0]))[:2]
        if abs(math.atan2(y, abs(x))) > STEEPEST:
            return 0
        return 1 if x > 0.0 else -1

    def _is_stuck(self, ctx: Context) -> bool:
        assert self._axis is not None
        self._watch.update(ctx.stamp, *se2.between(self._axis, ctx.pose)[:2].tolist())
        return self._watch.standing(ctx.stamp) > GIVE_UP_AFTER


def _between_doors(ctx: Context) -> bool:
    """Whether the body is between the doors of a lift; in the cabin there is room to turn."""
    body = se2.transformed(ctx.pose, ctx.footprint.polygon)
    zones = lifts(ctx.costmap.static.overlays)
    return any(whereabouts(zone, body) != "inside" and inside_convex(with_doors(zone), body).any() for zone in zones)


def _way_out(ctx: Context, direction: int) -> float:
    """Metres to go straight in a direction until no corner of the body is in a lift or between its doors."""
    areas = [with_doors(zone) for zone in lifts(ctx.costmap.static.overlays)]
    for way in np.arange(0.0, LONGEST, STEP):
        there = se2.compose(ctx.pose, np.array([direction * way, 0.0, 0.0]))
        body = se2.transformed(there, ctx.footprint.polygon)
        if not any(inside_convex(area, body).any() for area in areas):
            return float(way)
    return 0.0
