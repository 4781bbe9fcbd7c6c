"""``align_with_rack`` and ``to_unload_point`` with a ``rack_area_id``: look at the rack points of the area and take the
first that holds a rack, or that is free.

An area is a polygon of region type 17, its points are the rack points inside. They are taken in the order of the map's
features; where a patrol line (line type 4) runs through the area, in the order along it. A point that no scan has shown
for ``rack_state_fresh`` seconds is looked at first, from the patrol line, or else from before, behind or beside it.
``properties.rack_layer`` is an index into the ``rackLevels`` of the area, which has the floor at least; points whose
``enabledLevels`` do not have that level are left out. ``route_coordinates`` are driven first, before any point is
looked at.

Why such a move fails, beside the reasons of ``align_with_rack`` and ``to_unload_point`` that no other point can help:

==== ============================== ===================================================================================
  #  reason                         raised
==== ============================== ===================================================================================
507  invalid_rack_area_id           at start: the map has no area of that id
508  invalid_rack_area              at start: there is no rack point in the area, or none with the wanted level
509  unknown_rack_space_state       no point was taken, and of some the state is not visible from where the chassis can
                                    get to
510  no_rack_in_rack_area           align: all points are free
511  align_failed_in_rack_area      align: there is something at one point or more, but docking to it failed
512  no_free_space_in_rack_area     unload: all points are occupied
513  failed_to_unload_in_rack_area  unload: one point or more is free, but the rack cannot be brought there
==== ============================== ===================================================================================
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from rackhand.schemas.base import NANOSECONDS, Pose2
from rackhand.schemas.explain import Evidence, Measure, Thing
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.maps import LineType, PointType, RegionType
from rackhand.schemas.moves import MoveCreate, PlanningFlag
from rackhand.schemas.racks import Occupancy
from rackhand.services.planner.behaviors import align_with_rack, to_unload_point
from rackhand.services.planner.behaviors.align_with_rack import RackTarget, check_jack_down
from rackhand.services.planner.behaviors.approach import route_first
from rackhand.services.planner.behaviors.base import Behavior, Context, Done, Drive, Status
from rackhand.services.planner.behaviors.drive_to_pose import DriveToPose
from rackhand.services.planner.behaviors.to_unload_point import ToUnloadPoint, UnloadTarget, check_cargo
from rackhand.services.planner.control.goal_checker import is_still
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.load import Load
from rackhand.services.planner.map.overlays import Line, MapOverlays, PointOfInterest, Zone
from rackhand.services.planner.perception.lift_view import hiding
from rackhand.services.planner.perception.rack_points import STANDS_AT
from rackhand.services.planner.perception.viewpoints import along, viewpoints
from rackhand.services.planner.planning.goals import Goal

ARRIVED = 0.3  # m from a viewpoint, within which the chassis is there
LOOK = 2.0  # s that it looks from there

# What ends a drive to a viewpoint, or the work at a point, but not the whole move.
_ON_THE_WAY = frozenset(
    {
        Reason.ENDING_POINT_OUT_OF_MAP,
        Reason.ENDING_POINT_NOT_IN_GROUND,
        Reason.CALCULATION_FAILED,
        Reason.CALCULATION_TIMEOUT,
        Reason.NO_GLOBAL_PATH,
        Reason.PLANNING_TIMEOUT,
        Reason.MOVE_TIMEOUT,
        Reason.ROTATE_TIMEOUT,
    }
)


def align_for_request(request: MoveCreate) -> Behavior:
    """At a point or in an area."""
    return in_area(request, AlignTask()) if request.rack_area_id else align_with_rack.for_request(request)


def unload_for_request(request: MoveCreate) -> Behavior:
    """At a point or in an area."""
    return in_area(request, UnloadTask()) if request.rack_area_id else to_unload_point.for_request(request)


def in_area(request: MoveCreate, task: Task) -> Behavior:
    """After the request's route. Raises ``MoveFailed(INVALID_TRACK_POINTS)``."""
    area = RackArea(request.model_copy(update={"route_coordinates": None}), task)
    return route_first(request, area, area.check)


class Task(Protocol):
    """What is to be done at the first point that is in the state ``wanted``.

    ``failed``: the reason if it did not succeed at any such point; ``none``: if there is no such point.
    ``recoverable``: reasons of a single point.
    """

    flag: PlanningFlag
    wanted: Occupancy
    failed: Reason
    none: Reason
    recoverable: frozenset[Reason]

    def check(self, ctx: Context) -> None:
        """Raises ``MoveFailed`` where it cannot be begun at all."""

    def at(self, request: MoveCreate, point: PointOfInterest) -> Behavior:
        """The work there."""


class AlignTask:
    flag: PlanningFlag = "aligning_with_rack"
    wanted: Occupancy = "occupied"
    failed, none = Reason.ALIGN_FAILED_IN_RACK_AREA, Reason.NO_RACK_IN_RACK_AREA
    recoverable = _ON_THE_WAY | {Reason.RACK_DETECTION_ERROR, Reason.RACK_RETRY_COUNT_EXCEEDED}

    def check(self, ctx: Context) -> None:
        check_jack_down(ctx)

    def at(self, request: MoveCreate, point: PointOfInterest) -> Behavior:
        yaw = point.dock_yaw or 0.0 if request.target_ori is None else request.target_ori
        return align_with_rack.align_with_rack(request, RackTarget(point, yaw))


class UnloadTask:
    flag: PlanningFlag = "unloading_rack"
    wanted: Occupancy = "free"
    failed, none = Reason.FAILED_TO_UNLOAD_IN_RACK_AREA, Reason.NO_FREE_SPACE_IN_RACK_AREA
    recoverable = frozenset({Reason.UNLOAD_POINT_OCCUPIED, Reason.UNLOAD_POINT_UNREACHABLE})

    def check(self, ctx: Context) -> None:
        jack = ctx.state.jack
        check_cargo(ctx.load, None if jack is None else jack.progress)

    def at(self, request: MoveCreate, point: PointOfInterest) -> Behavior:
        yaw = point.dock_yaw if request.target_ori is None else request.target_ori
        return ToUnloadPoint(request, UnloadTarget(point.x, point.y, yaw, name_of(point)))


@dataclass(frozen=True)
class Area:
    """A rack area with its points, in the order in which they are taken; ``patrol`` is None where no line is drawn."""

    zone: Zone
    points: tuple[PointOfInterest, ...]
    patrol: Line | None

    def __str__(self) -> str:
        return f"rack area {self.zone.name or self.zone.id!r}"


def area_of(request: MoveCreate, overlays: MapOverlays) -> Area:
    """Raises ``MoveFailed``: 507, 508."""
    wanted = request.rack_area_id or ""
    areas = overlays.zones_of(RegionType.RACK_ZONE)
    zone = next((area for area in areas if area.id == wanted), None)
    if zone is None:
        known = ", ".join(area.id for area in areas) or "none"
        raise MoveFailed(Reason.INVALID_RACK_AREA_ID, f"the map has no rack area {wanted!r:.80}; known: {known}")
    inside = [p for p in overlays.points_of(PointType.RACK) if zone.contains(p.x, p.y)]
    layer = request.properties.get("rack_layer")
    points = [p for p in inside if layer is None or is_enabled(p, zone, layer)]
    name = zone.name or zone.id
    if not points:
        levels = f" with level {layer!r}" if inside else ""
        x, y = zone.rings[0][:-1].mean(axis=0).round(3).tolist()
        area = Thing(role="expected", kind="rack point", name=name, x=x, y=y)
        text = f"there is no rack point{levels} in rack area {name!r}"
        raise MoveFailed(Reason.INVALID_RACK_AREA, text).about(area)
    lines = overlays.lines_of(LineType.RACK_PATROL)
    patrol = next((line for line in lines if any(zone.contains(x, y) for x, y in line.points)), None)
    if patrol is not None:
        points.sort(key=lambda p: along(patrol.points, np.array([p.x, p.y]))[0])
    return Area(zone, tuple(points), patrol)


def is_enabled(point: PointOfInterest, zone: Zone, layer: object) -> bool:
    """Whether a point has a level of its area; one that names none has all."""
    levels = _list(zone.properties.get("rackLevels")) or [{"id": 0}]  # the floor
    if isinstance(layer, bool) or not isinstance(layer, int) or not 0 <= layer < len(levels):
        return False
    enabled = _list(point.properties.get("enabledLevels"))
    level = levels[layer]
    return not enabled or layer in enabled or (isinstance(level, dict) and level.get("id") in enabled)


def _list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def name_of(point: PointOfInterest) -> str:
    return point.name or point.id


class RackArea:
    """Behaviour of a move in an area. Its stages are written as one procedure that yields what to drive."""

    _ctx: Context
    _area: Area

    def __init__(self, request: MoveCreate, task: Task) -> None:
        self._request, self._task = request, task
        self._steps: Generator[Drive, None, Load | None] | None = None
        self._inner: Behavior | None = None
        self._status = Status()
        self._undecided: list[str] = []
        self._failures: list[str] = []
        self._evidence = Evidence()

    def step(self, ctx: Context) -> Drive | Done:
        self._ctx = ctx
        if self._steps is None:
            self.check(ctx)
            self._steps = self._run()
        try:
            return next(self._steps)
        except StopIteration as ended:
            return Done(ended.value)

    def check(self, ctx: Context) -> None:
        """Of the request and of the chassis, before it begins. Raises ``MoveFailed``."""
        self._task.check(ctx)
        self._area = area_of(self._request, ctx.costmap.static.overlays)

    def resume(self, ctx: Context) -> None:
        if self._inner is not None:
            self._inner.resume(ctx)

    def status(self) -> Status:
        return self._status

    # -- procedure ---------------------------------------------------------------------------------------------------

    def _run(self) -> Generator[Drive, None, Load | None]:
        """Each point in turn, until the work is done at one."""
        for point in self._area.points:
            yield from self._look_at(point)
            state = self._state(point)
            if state == "unknown":
                self._undecided.append(name_of(point))
                self._keep(things=self._out_of_sight(point))
            elif state == self._task.wanted:
                done = yield from self._work_at(point)
                if done is not None:
                    return done.load
        raise self._exhausted()

    def _look_at(self, point: PointOfInterest) -> Generator[Drive, None, None]:
        """Drive to where the point can be seen, unless its state is known; give up where it is not seen from there."""
        if self._state(point) != "unknown":
            return
        line = None if self._area.patrol is None else self._area.patrol.points
        ctx = self._ctx
        for x, y in viewpoints(ctx.costmap, ctx.footprint, ctx.pose, point, line):
            try:
                yield from self._drive_until_known(Goal(x, y, None, ARRIVED, zone=True), point)
            except MoveFailed as failed:
                if failed.reason not in _ON_THE_WAY:
                    raise
                continue
            end = self._ctx.stamp + LOOK * NANOSECONDS
            while self._ctx.stamp < end and self._state(point) == "unknown":
                yield Drive(STANDSTILL)
            if self._state(point) != "unknown":
                return

    def _drive_until_known(self, goal: Goal, point: PointOfInterest) -> Generator[Drive, None, None]:
        self._inner = DriveToPose(goal)
        while self._state(point) == "unknown":
            outcome = self._inner.step(self._ctx)
            self._status = self._looking(self._inner.status(), point)
            if isinstance(outcome, Done):
                break
            yield outcome
        self._inner = None
        self._ctx.plans.cancel()

    def _work_at(self, point: PointOfInterest) -> Generator[Drive, None, Done | None]:
        """The end of the work there; None where it did not succeed, or the point is not free any more."""
        while not is_still(self._ctx.twist):
            yield Drive(STANDSTILL)
        self._inner = self._task.at(self._request, point)
        try:
            while True:
                outcome = self._inner.step(self._within_area())
                self._status = self._inner.status()
                if isinstance(outcome, Done):
                    return outcome
                yield outcome
                if self._task.wanted == "free" and self._state(point) == "occupied":
                    return None
        except MoveFailed as failed:
            if failed.reason not in self._task.recoverable:
                raise
            if failed.reason is not Reason.UNLOAD_POINT_OCCUPIED:
                self._failures.append(f"{name_of(point)}: {failed.reason.rest_name}: {failed.text}")
                self._keep(failed.evidence.things, failed.evidence.measures)
            return None
        finally:
            self._inner = None
            self._ctx.plans.cancel()

    def _looking(self, status: Status, point: PointOfInterest) -> Status:
        """Of the drive to a viewpoint, shown as that of the work at the point, which has no path of its own."""
        place = Pose2(x=point.x, y=point.y, yaw=point.yaw or 0.0)
        return replace(status, intent_target=place, remaining_distance=0.0, flags=frozenset({self._task.flag}))

    def _within_area(self) -> Context:
        """Another point may be free: what is in the way at this one is not waited for long."""
        s = self._ctx.settings
        return replace(self._ctx, settings=replace(s, unload_patience=s.area_patience))

    def _state(self, point: PointOfInterest) -> Occupancy:
        fresh = round(self._ctx.settings.rack_state_fresh * NANOSECONDS)
        return self._ctx.costmap.rack_points.state(point.id, self._ctx.stamp - fresh)

    def _exhausted(self) -> MoveFailed:
        area, number = self._area, len(self._area.points)
        if self._failures:
            return MoveFailed(self._task.failed, f"{area}: {'; '.join(self._failures)}"[:1000], self._evidence)
        if self._undecided:
            names = ", ".join(self._undecided)
            text = f"{area}: of {len(self._undecided)} of {number} rack points the state is not visible: {names}"
            return MoveFailed(Reason.UNKNOWN_RACK_SPACE_STATE, text, self._evidence)
        all_are = "free" if self._task.wanted == "occupied" else "occupied"
        names = ", ".join(name_of(point) for point in area.points)
        failed = MoveFailed(self._task.none, f"{area}: all {number} rack points are {all_are}: {names}")
        return failed.about(*(self._found_at(point) for point in area.points))

    # -- evidence ----------------------------------------------------------------------------------------------------

    def _keep(self, things: Sequence[Thing] = (), measures: Sequence[Measure] = ()) -> None:
        """Of one of the points, why nothing could be done there."""
        known = self._evidence
        self._evidence = Evidence(things=(*known.things, *things), measures=(*known.measures, *measures))

    def _out_of_sight(self, point: PointOfInterest) -> tuple[Thing, ...]:
        """A point whose state is not known, and what hides it from here."""
        ctx, unseen = self._ctx, Thing(role="expected", kind="rack point", name=name_of(point), x=point.x, y=point.y)
        if ctx.seen is None:
            return (unseen,)
        sensor = se2.compose(ctx.seen.chassis, ctx.seen.sensor)
        screen = hiding(ctx.costmap, sensor, np.array([point.x, point.y]))
        return (unseen,) if screen is None else (screen, unseen)

    def _found_at(self, point: PointOfInterest) -> Thing:
        """What is at a point: a rack that is missing, or what occupies it."""
        name = name_of(point)
        if self._task.wanted == "occupied":
            return Thing(role="expected", kind="rack", name=name, x=point.x, y=point.y)
        rack = self._ctx.costmap.racks.near(point.x, point.y, STANDS_AT)
        if rack is None:
            return Thing(role="blocks", kind="observed obstacle", name=name, x=point.x, y=point.y)
        x, y = rack.pose[:2].round(3).tolist()
        return Thing(role="blocks", kind="rack", name=name, x=x, y=y)
