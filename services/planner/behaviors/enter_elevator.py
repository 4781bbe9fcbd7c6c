"""``enter_elevator``: drive into a lift that is at this floor, and stop at a pose in its cabin.

The target is in a zone of type 3 of the map, the inside of the cabin. The chassis calls no lift and closes no door: its
client does, and keeps the door open until the move has ended (docs/lifts.md). It drives to the doorway as a
``standard`` move does, around what is in the way, and looks from about a metre before the door. From there on the
rules of ``control.lift_entry`` hold: what it waits for, and fail reasons 300 to 304.

Doors, people and loads in the cabin are seen by the lidar alone. A chassis that gets no nearer and is within 0.2 m of
its place has arrived.

Why such a move fails, beside the reasons of a ``standard`` move and 300 to 304:

==== ========================== =======================================================================================
  #  reason                     raised
==== ========================== =======================================================================================
 21  ending_point_not_specified at start: without ``target_x`` and ``target_y``
1005 configuration_error        at start: the target is in no zone of type 3
==== ========================== =======================================================================================
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rackhand.schemas.explain import Thing
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.base import Array, Behavior, Context, Done, Drive, Status
from rackhand.services.planner.behaviors.drive_to_pose import DriveToPose, goal_of
from rackhand.services.planner.control.lift_entry import Entry, EntryRules, LiftView, PointState
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import STANDSTILL, Pose, compose, transformed
from rackhand.services.planner.map.overlays import Zone
from rackhand.services.planner.perception.lift_view import (
    DoorWatch,
    Doorway,
    doorway_in_sight,
    find_doorway,
    hiding,
    lift_at,
    nearest_lift,
    point_state,
    standing_in,
    whereabouts,
    with_doors,
)
from rackhand.services.planner.planning.goals import Goal

_OUT_OF_SIGHT = frozenset(
    {MoveFailReason.ELEVATOR_POINT_OBSCURED_TIMEOUT, MoveFailReason.ELEVATOR_POINT_OCCUPANCY_DETECTION_TIMEOUT}
)
LOOK_FROM = 1.2  # m between the body and the doorway, from which on the rules hold


def for_request(request: MoveCreate) -> Behavior:
    """Raises ``MoveFailed(ENDING_POINT_NOT_SPECIFIED)``."""
    if request.target_x is None or request.target_y is None:
        text = "enter_elevator needs target_x and target_y, a place in the lift"
        raise MoveFailed(MoveFailReason.ENDING_POINT_NOT_SPECIFIED, text)
    # The whole body must get into the cabin: a target zone, which ends a move at its rim, means nothing here.
    return EnterElevator(replace(goal_of(request), zone=False), request.target_x, request.target_y)


class EnterElevator:
    """``_drive`` does the driving; it is not stepped while the chassis waits."""

    _zone: Zone

    def __init__(self, goal: Goal, x: float, y: float) -> None:
        self._goal, self._at = goal, np.array([x, y])
        self._drive = DriveToPose(goal)
        self._rules = EntryRules()
        self._doorway: Doorway | None = None
        self._door = DoorWatch()
        self._plans = -1
        self._open = False  # the place and the way to it were seen free: plan around what is there
        self._waiting = False
        self._begun = False
        self._status = Status()

    def step(self, ctx: Context) -> Drive | Done:
        if not self._begun:
            self._begin(ctx)
        view = self._look(ctx)
        entry = Entry() if view is None else self._decide(ctx, view)
        if entry.arrived:
            return Done()
        self._open = view is not None and view.point == "free" and view.door == "open"
        outcome = self._go(ctx) if entry.drive else self._wait()
        self._report(entry, view)
        return outcome

    def resume(self, ctx: Context) -> None:
        self._rules.restart()
        self._drive.resume(ctx)

    def status(self) -> Status:
        return self._status

    def _begin(self, ctx: Context) -> None:
        x, y = self._at.tolist()
        zone = lift_at(ctx.costmap.static.overlays, x, y)
        if zone is None:
            overlays = ctx.costmap.static.overlays
            text = f"the target ({x:.2f}, {y:.2f}) is in no lift: the map has no zone of type 3 there"
            place = Thing(role="expected", kind="place", x=x, y=y)
            raise MoveFailed(MoveFailReason.CONFIGURATION_ERROR, text).about(place, nearest_lift(overlays, self._at))
        self._zone, self._begun = zone, True

    # -- driving -----------------------------------------------------------------------------------------------------

    def _go(self, ctx: Context) -> Drive | Done:
        through = ctx if self._open else replace(ctx, costmap=ctx.costmap.planning_through(with_doors(self._zone)))
        if self._waiting:
            self._drive.resume(through)
            self._waiting = False
        outcome = self._drive.step(through)
        status = self._drive.status()
        if status.plans != self._plans and len(status.path):
            self._plans = status.plans
            self._doorway = find_doorway(ctx.costmap.static, self._zone, status.path) or self._doorway
        return outcome

    def _wait(self) -> Drive:
        self._waiting = True
        return Drive(STANDSTILL)

    # -- what is seen ------------------------------------------------------------------------------------------------

    def _look(self, ctx: Context) -> LiftView | None:
        """None while the chassis is too far away, or too far aside, to judge."""
        if self._doorway is None:  # no path yet: something may be in the way of every one
            self._doorway = doorway_in_sight(ctx.costmap.static, self._zone, ctx.pose[:2], self._at)
        body = transformed(ctx.pose, ctx.footprint.polygon)
        where = whereabouts(self._zone, body)
        if self._doorway is not None:
            if ctx.seen is not None:
                self._door.take(ctx.seen.stamp, self._doorway.covered(ctx.costmap.observed.points))
            if where == "outside" and self._doorway.has_begun(body):
                where = "in_doorway"
        if where == "outside" and not self._is_near(ctx):
            return None
        return LiftView(
            stamp=ctx.stamp,
            where=where,
            point=self._point(ctx),
            door="closed" if self._door.is_closed else "closing" if self._door.is_closing else "open",
            away=math.dist(self._at, ctx.pose[:2]),
            standing=0.0 if self._waiting else self._drive.standing(ctx.stamp),
            blocked=ctx.vetoed or self._drive.status().viewport_blocked,
        )

    def _is_near(self, ctx: Context) -> bool:
        if self._doorway is None or not self._doorway.is_before(ctx.pose[:2]):
            return False
        return math.dist(self._doorway.middle, ctx.pose[:2]) < LOOK_FROM + float(ctx.footprint.polygon[:, 0].max())

    def _point(self, ctx: Context) -> PointState:
        if ctx.seen is None:
            return "unknown"
        return point_state(ctx.costmap, ctx.seen, ctx.pose, ctx.footprint, self._place(ctx))

    def _place(self, ctx: Context) -> Pose:
        """Where the chassis is to stand; of any heading: with that of the doorway."""
        yaw = self._goal.yaw
        if yaw is None:
            into: Array | None = None if self._doorway is None else self._doorway.into
            yaw = float(ctx.pose[2]) if into is None else math.atan2(into[1], into[0])
        return np.array([*self._at, yaw])

    def _decide(self, ctx: Context, view: LiftView) -> Entry:
        """Raises ``MoveFailed`` with what is seen of the cause."""
        try:
            return self._rules.decide(view)
        except MoveFailed as failed:
            raise failed.about(*self._seen_of(ctx, failed.reason)) from None

    def _seen_of(self, ctx: Context, reason: MoveFailReason) -> tuple[Thing | None, ...]:
        """What is in the way or hides the place, and the place where the chassis was to stand."""
        x, y = self._at.round(3).tolist()
        place = Thing(role="expected", kind="place", name=self._name, x=x, y=y)
        match reason:
            case MoveFailReason.ELEVATOR_CLOSED if self._doorway is not None:
                x, y = self._doorway.middle.round(3).tolist()
                return Thing(role="blocks", kind="lift door", name=self._name, x=x, y=y), place
            case MoveFailReason.ELEVATOR_POINT_OCCUPIED:
                return standing_in(ctx.costmap, ctx.footprint, self._place(ctx)), place
            case _ if reason in _OUT_OF_SIGHT and ctx.seen is not None:
                return hiding(ctx.costmap, compose(ctx.seen.chassis, ctx.seen.sensor), self._at), place
        return (place,)

    @property
    def _name(self) -> str:
        return self._zone.name or self._zone.id

    def _report(self, entry: Entry, view: LiftView | None) -> None:
        status = self._drive.status()
        self._status = replace(
            status,
            notice=entry.notice,
            stuck_state="none" if not entry.drive else "move_stucked" if entry.notice else status.stuck_state,
            viewport_blocked=status.viewport_blocked or (view is not None and view.point == "obscured"),
            flags=frozenset({"is_waiting_for_dest"}) if not entry.drive else frozenset(),
        )
