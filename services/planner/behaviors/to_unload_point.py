"""``to_unload_point``: drive so that the *rack* on the jack ends at a point, if the place is free.

The goal of the chassis is the target pose of the rack, composed with the inverse of where the rack is on the jack. A
target need not be a rack point of the map. Without ``target_ori`` the rack takes the docking heading of the rack point
within ``rack_point_radius``; where there is none, one of a few headings that the map has room for. With
``route_coordinates`` it is driven along that route first, as by a standard move.

Why such a move fails beside the reasons of a standard move for a start (3, 5) and for what the chassis lacks (2, 16,
17, 1000):

==== ========================== =======================================================================================
  #  reason                     raised
==== ========================== =======================================================================================
500  invalid_rack_detection_pos at start: ``properties.rack_layer`` is no level of the area that the point is in
503  unload_point_occupied      for ``unload_patience`` the scan shows something where the rack would be, while the
                                chassis waits for it in front of the place
504  unload_point_unreachable   the rack would overlap what is not traversable or leave the map; or a standard move to
                                there fails (4, 6, 9, 10, 11, 14, 15, 18; the text names which)
517  cargo_ready_not_triggered  at start: there is no rack on the jack, or the jack is not fully up
==== ========================== =======================================================================================
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rackhand.schemas.base import NANOSECONDS, Pose2
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import PointType
from rackhand.schemas.moves import MoveCreate, PlanningFlag
from rackhand.services.planner.behaviors.align_with_rack import checked_layer
from rackhand.services.planner.behaviors.approach import approach
from rackhand.services.planner.behaviors.base import Behavior, Context, Done, Drive, Status
from rackhand.services.planner.behaviors.drive_to_pose import DriveToPose
from rackhand.services.planner.control.goal_checker import is_still
from rackhand.services.planner.errors import MoveFailed, elapsed
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.footprint import expanded
from rackhand.services.planner.geometry.polygon import inside_convex
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.jacking import REACHED
from rackhand.services.planner.load import Load, LoadState
from rackhand.services.planner.map.overlays import MapOverlays
from rackhand.services.planner.perception.things import thing_at
from rackhand.services.planner.planning.goals import Goal, check_goal
from rackhand.services.planner.planning.plan import Target
from rackhand.services.planner.settings import NavigationSettings

IN_VIEW = 5.0  # m from the place, within which the local costmap covers it
OVERLAP = 0.2  # of a cell, by which the rack's outline may overlap an observed one: scan noise moves cells that much
THROUGH = 0.15  # m around the place, within which plans ignore what is observed
FLAGS: frozenset[PlanningFlag] = frozenset({"unloading_rack"})
HEADINGS = 8  # that are tried where any will do
WAY_IN, WAY_IN_STEP = 1.5, 0.25  # m of straight way before a place by which headings are compared

# What of a standard move means that the place cannot be reached.
_UNREACHABLE = frozenset(
    {
        MoveFailReason.ENDING_POINT_OUT_OF_MAP,
        MoveFailReason.ENDING_POINT_NOT_IN_GROUND,
        MoveFailReason.CALCULATION_FAILED,
        MoveFailReason.CALCULATION_TIMEOUT,
        MoveFailReason.NO_GLOBAL_PATH,
        MoveFailReason.PLANNING_TIMEOUT,
        MoveFailReason.MOVE_TIMEOUT,
        MoveFailReason.ROTATE_TIMEOUT,
    }
)


@dataclass(frozen=True)
class UnloadTarget:
    """Where the rack is to be put down: metres in the map frame; ``yaw`` in radians, None for any. ``name`` is that of
    the rack point there, empty where there is none."""

    x: float
    y: float
    yaw: float | None = None
    name: str = ""

    def __str__(self) -> str:
        return f"({self.x:.2f}, {self.y:.2f})" + (f", rack point {self.name!r}" if self.name else "")


def target_of(request: MoveCreate, overlays: MapOverlays, radius: float) -> UnloadTarget:
    """The target of a request with coordinates; raises ``MoveFailed`` without them."""
    if request.target_x is None or request.target_y is None:
        text = "to_unload_point needs target_x and target_y, or rack_area_id"
        raise MoveFailed(MoveFailReason.UNLOAD_POINT_UNREACHABLE, text)
    point = overlays.nearest_point(PointType.RACK, request.target_x, request.target_y, radius)
    if point is not None:
        checked_layer(request.properties.get("rack_layer"), point, overlays)
    yaw = request.target_ori
    if yaw is None and point is not None:
        yaw = point.dock_yaw
    return UnloadTarget(request.target_x, request.target_y, yaw, "" if point is None else point.name or point.id)


def check_cargo(load: Load, progress: float | None) -> None:
    """Raises ``MoveFailed`` unless a rack is on a jack that is fully up. ``progress``: of the jack, 0 to 1."""
    if load.state is not LoadState.CARRYING or load.rack_pose is None:
        text = f"there is no rack on the jack (load: {load.state.value}); lift one with jack_up first"
    elif progress is None or progress < 1.0 - REACHED:
        where = "unknown" if progress is None else f"at {progress:.0%}"
        text = f"the jack is {where}, want 100 %: call jack_up and wait until it has arrived"
    else:
        return
    raise MoveFailed(MoveFailReason.CARGO_READY_NOT_TRIGGERED, text)


def chassis_goal(load: Load, x: float, y: float, yaw: float) -> Pose:
    """The pose of the chassis, (3,) in the map frame, at which the carried rack is at ``x``, ``y``, ``yaw``."""
    rack_to_chassis = se2.between(np.array(load.rack_pose), np.zeros(3))
    return se2.compose(np.array([x, y, yaw]), rack_to_chassis)


def reachable_goal(ctx: Context, target: UnloadTarget) -> Pose:
    """The chassis' goal for a target, (3,) in the map frame. Raises 504 where the map has no room for it.

    For a target of any yaw it is the heading along which the map has the longest straight way in, of those the nearest
    to the rack's present one.
    """
    assert ctx.load.rack_pose is not None
    now = se2.compose(ctx.pose, np.array(ctx.load.rack_pose))[2]
    yaws = [now + k * math.tau / HEADINGS for k in range(HEADINGS)] if target.yaw is None else [target.yaw]
    goals, failed = [], None
    for yaw in yaws:
        goal = chassis_goal(ctx.load, target.x, target.y, yaw)
        try:
            check_goal(ctx.costmap, ctx.footprint, Target(*goal.tolist()), ctx.settings)
            goals.append(goal)
        except MoveFailed as no_room:
            failed = failed or no_room
    if failed is not None and not goals:
        raise _unreachable(failed, target)
    return min(goals, key=lambda goal: (-_way_in(ctx, goal), abs(se2.wrap(goal[2] - ctx.pose[2]))))


def _way_in(ctx: Context, goal: Pose) -> float:
    """Metres, up to ``WAY_IN``, that the map leaves free on the straight line behind the goal or before it."""
    longest = 0.0
    for sign in (-1.0, 1.0):
        for away in np.arange(WAY_IN_STEP, WAY_IN + 1e-6, WAY_IN_STEP):
            place = se2.compose(goal, np.array([sign * away, 0.0, 0.0]))
            if ctx.costmap.mapped.clearance(ctx.footprint, place) < 0.0:
                break
            longest = max(longest, float(away))
    return longest


def _unreachable(failed: MoveFailed, target: UnloadTarget) -> MoveFailed:
    text = f"{failed.reason.rest_name}: {failed.text}; the rack was to be put down at {target}"
    return MoveFailed(MoveFailReason.UNLOAD_POINT_UNREACHABLE, text, failed.evidence)


def is_occupied(ctx: Context, goal: Pose) -> bool:
    """Whether observed obstacles overlap the chassis with its rack at ``goal``; False out of view."""
    if math.hypot(goal[0] - ctx.pose[0], goal[1] - ctx.pose[1]) > IN_VIEW:
        return False
    near = ctx.costmap.near
    return near.clearance(ctx.footprint, goal) < -OVERLAP * near.geometry.resolution


def tightened(s: NavigationSettings) -> NavigationSettings:
    """The tolerances of arrival for setting down a rack."""
    return replace(
        s,
        position_tolerance=s.unload_position_tolerance,
        yaw_tolerance=s.unload_yaw_tolerance,
        equal_yaw=s.unload_yaw_tolerance,
    )


def for_request(request: MoveCreate) -> Behavior:
    return ToUnloadPoint(request)


class ToUnloadPoint:
    """Drives as a standard move does, with tighter tolerances, and watches the place meanwhile."""

    _target: UnloadTarget
    _drive: Behavior

    def __init__(self, request: MoveCreate, target: UnloadTarget | None = None) -> None:
        """``target``: in place of the request's."""
        self._request = request
        self._chosen = target
        self._begun = False
        self._goal: Pose = np.zeros(3)
        self._rack_pose: tuple[float, float, float] | None = None
        self._occupied_since: int | None = None
        self._status = Status()

    def _begin(self, ctx: Context) -> None:
        jack = ctx.state.jack
        check_cargo(ctx.load, None if jack is None else jack.progress)
        overlays = ctx.costmap.static.overlays
        self._target = self._chosen or target_of(self._request, overlays, ctx.settings.rack_point_radius)
        self._plan(ctx)
        self._begun = True

    def _plan(self, ctx: Context) -> None:
        """Begin to drive to where the chassis must be; anew where the rack has moved on the jack."""
        self._rack_pose = ctx.load.rack_pose
        self._goal = reachable_goal(ctx, self._target)
        x, y, yaw = self._goal.tolist()
        goal = Goal(x, y, yaw, ctx.settings.unload_accuracy)
        self._drive = DriveToPose(goal) if self._begun else approach(goal, self._request)

    # -- stages ------------------------------------------------------------------------------------------------------

    def step(self, ctx: Context) -> Drive | Done:
        if not self._begun:
            self._begin(ctx)
        elif ctx.load.rack_pose != self._rack_pose:
            self._plan(ctx)
        occupied = self._watch(ctx)
        try:
            outcome = self._drive.step(self._inner(ctx))
        except MoveFailed as failed:
            raise self._explained(failed, occupied) from failed
        self._status = self._shown()
        return outcome

    def resume(self, ctx: Context) -> None:
        self._occupied_since = None
        if self._begun:
            self._drive.resume(self._inner(ctx))

    def status(self) -> Status:
        return self._status

    def _inner(self, ctx: Context) -> Context:
        """What the drive is given: tighter tolerances, and a costmap whose plans lead up to what is in the place."""
        place = expanded(self._outline(ctx), THROUGH)
        return replace(ctx, settings=tightened(ctx.settings), costmap=ctx.costmap.planning_through(place))

    def _outline(self, ctx: Context) -> np.ndarray:
        """What the chassis with its rack covers at the goal, (n, 2) in the map frame."""
        return se2.transformed(self._goal, ctx.footprint.polygon)

    # -- the place ---------------------------------------------------------------------------------------------------

    def _watch(self, ctx: Context) -> bool:
        """Whether something is in the place; raises 503 when it has been for too long while the chassis waited."""
        if not is_occupied(ctx, self._goal):
            self._occupied_since = None
            return False
        if not is_still(ctx.twist):
            self._occupied_since = None
        elif self._occupied_since is None:
            self._occupied_since = ctx.stamp
        since = self._occupied_since
        if since is not None and ctx.stamp - since >= ctx.settings.unload_patience * NANOSECONDS:
            raise self._occupied(ctx)
        return True

    def _occupied(self, ctx: Context) -> MoveFailed:
        points = np.empty((0, 2)) if ctx.seen is None else ctx.seen.in_map
        hits = points[inside_convex(self._outline(ctx), points)]
        what, x, y = "what was seen there before", self._target.x, self._target.y
        if len(hits):
            x, y = hits.mean(axis=0).tolist()
            what = f"an obstacle about ({x:.2f}, {y:.2f})"
        patience = ctx.settings.unload_patience
        waited = f"for {patience:.0f} s while the chassis waited for it to leave"
        text = f"{what} overlaps the place of the rack, {self._target}, {waited}"
        lasted = elapsed("time that the place was occupied", patience, patience)
        return MoveFailed(MoveFailReason.UNLOAD_POINT_OCCUPIED, text).about(
            thing_at(ctx.costmap, x, y), measures=(lasted,)
        )

    def _explained(self, failed: MoveFailed, occupied: bool) -> MoveFailed:
        if failed.reason not in _UNREACHABLE:
            return failed
        if occupied:
            text = f"something is where the rack would be, at {self._target}: {failed.text}"
            return MoveFailed(MoveFailReason.UNLOAD_POINT_OCCUPIED, text, failed.evidence)
        return _unreachable(failed, self._target)

    def _shown(self) -> Status:
        target = self._target
        yaw = float(self._goal[2]) if target.yaw is None else target.yaw
        place = Pose2(x=target.x, y=target.y, yaw=yaw)
        return replace(self._drive.status(), intent_target=place, remaining_distance=0.0, flags=FLAGS)
