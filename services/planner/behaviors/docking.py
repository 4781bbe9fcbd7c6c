"""Docking, one procedure for whatever can be docked to: drive to a staging pose before it, look at it, drive onto it;
where that fails, back out and try anew."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.explain import Thing
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import PlanningFlag
from rackhand.schemas.racks import DetectedRack
from rackhand.services.planner.behaviors.base import Array, Context, Done, Drive, Status
from rackhand.services.planner.behaviors.dock_view import DockView
from rackhand.services.planner.behaviors.drive_to_pose import DriveToPose
from rackhand.services.planner.control import docking
from rackhand.services.planner.control.docking import Funnel
from rackhand.services.planner.control.goal_checker import is_still
from rackhand.services.planner.control.progress_checker import RestWatch
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import STANDSTILL, Pose
from rackhand.services.planner.load import Load
from rackhand.services.planner.perception.seen_scan import SeenScan
from rackhand.services.planner.planning.goals import Goal

IN_VIEW = 4.0  # m from the chassis to a dock that is looked for
GLANCE, LOOK = 0.5, 2.0  # s of looking: before it drives, and at the staging pose
LOST_AFTER = 6  # scans in a row without a sighting
STRAIGHT_FROM = 0.4  # m beyond the farthest staging pose, from which on it drives straight onto the dock
ROUNDS = 3  # drives to a staging pose, each refined by what was seen at the one before
SHIFTED, SHIFTED_YAW = 0.05, 0.05  # off the staging pose driven to, from which on the drive begins anew
PATIENCE = 15.0  # s without progress on the way onto the dock or off it
TURNED = 0.003  # rad off the axis within which a docked chassis need not turn
_NO_STAGING = frozenset({Reason.ENDING_POINT_NOT_IN_GROUND, Reason.CALCULATION_FAILED, Reason.NO_GLOBAL_PATH})

ORIGIN = np.zeros(3)
Steps = Generator[Drive, None, None]
Attempt = Generator[Drive, None, bool]


@dataclass(frozen=True)
class Place:
    """A dock's geometry. ``prior``: its pose as registered, in the map. ``docked``: the chassis' pose in the dock's
    frame when it is docked. ``direction``: 1 driven forward onto it, -1 backward. ``staging``: metres before the docked
    pose at which to begin, the preferred one first. ``speed``: m/s onto it. ``lane``: convex polygon in the dock's
    frame, (n, 2), inside which the braking guard ignores obstacles; ``obstruction`` does not. ``mapped``: the same in
    the map, for the dock as it is on the map."""

    prior: Pose
    docked: Pose
    direction: int
    staging: tuple[float, ...]
    funnel: Funnel
    speed: float
    lane: Array | None = None
    mapped: Array | None = None


class Obstruction(NamedTuple):
    """In words, and where: (2,) in the dock's frame."""

    text: str
    place: Array


class Dockable(Protocol):
    """Something to dock to. Poses named ``dock`` are in the map. All may raise ``MoveFailed``."""

    intent: str

    def flags(self) -> frozenset[PlanningFlag]:
        """Of ``/planning_state``, now."""

    def begin(self, ctx: Context) -> None:
        """Checks of the request and of the chassis."""

    def stays_docked(self, ctx: Context) -> bool:
        """Whether docking begins where the chassis, which is docked to something, is now: it is this dock, or
        ``begin`` will fail."""

    def place(self, ctx: Context) -> Place:
        """Where the dock is to be, and its geometry by what is known of it."""

    def look(self, seen: SeenScan, prior: Pose) -> Pose | None:
        """The dock's pose in a scan, near ``prior``; both in the chassis frame at the scan."""

    def report(self, ctx: Context, found: Pose | None, staging: Pose) -> DetectedRack | None:
        """What is published of the last ``look``. ``found``: what it returned; ``staging``: in the map."""

    def missing(self, seen: SeenScan, dock: Pose) -> MoveFailed:
        """It was not found near ``dock``."""

    def check_place(self, dock: Pose) -> None:
        """Raises ``MoveFailed`` for a dock that is too far from where it should be."""

    def obstruction(self, points: Array, at: Pose) -> Obstruction | None:
        """What is on the way that is left. Points of the scan, (n, 2), and the chassis' pose in the dock's frame."""

    def load(self, body: Array, dock: Pose) -> Load | None:
        """The load of a chassis with that outline (map frame); None as long as it is not in the dock."""

    def is_docked(self, ctx: Context, off: Pose, waited: float) -> bool | None:
        """At rest where driving ended, ``off`` from the docked pose, for ``waited`` seconds. None: wait; False: back
        out and try anew."""

    def exhausted(self, attempts: int, why: str) -> MoveFailed:
        """No attempt succeeded; ``why`` not, the last one."""


class Docking:
    """One docking. ``intent_target`` of its status is the dock's pose by what is known of it."""

    _ctx: Context
    _place: Place
    _view: DockView
    _blocker: Thing | None  # of the attempt before

    def __init__(self, dock: Dockable, retries: int) -> None:
        self._dock = dock
        self._retries = retries
        self._steps: Iterator[Drive] | None = None
        self._drive: DriveToPose | None = None
        self._staging_distance = 0.0
        self._resumed = self._stuck = False
        self._why, self._blocker = "", None
        self._detected: DetectedRack | None = None

    # -- as a behaviour ----------------------------------------------------------------------------------------------

    def step(self, ctx: Context) -> Drive | Done:
        self._ctx = ctx
        if self._steps is None:
            self._dock.begin(ctx)
            self._place = self._dock.place(ctx)
            self._view = DockView(self._place.prior)
            self._staging_distance = self._place.staging[0]
            self._steps = self._procedure()
        self._look_at_scan()
        drive = next(self._steps, None)
        load = self._dock.load(se2.transformed(ctx.pose, ctx.footprint.polygon), self._view.in_map(ctx))
        if drive is None:
            return Done(load)
        return replace(drive, may_touch=self._may_touch(), load=load if _is_news(load, ctx.load) else None)

    def stays_docked(self, ctx: Context) -> bool:
        return self._dock.stays_docked(ctx)

    def resume(self, ctx: Context) -> None:
        """Nothing that was seen before the hold counts: the chassis, or the dock, may have been moved."""
        self._ctx = ctx
        if self._steps is None:
            return
        self._view.forget()
        self._resumed = True
        if self._drive is not None:
            self._drive.resume(ctx)

    def status(self) -> Status:
        if self._steps is None:
            return Status()
        driving = Status() if self._drive is None else self._drive.status()
        return replace(
            driving,
            target=None,
            intent=self._dock.intent,
            intent_target=se2.message(self._view.in_map(self._ctx)),
            remaining_distance=0.0,
            stuck_state="move_stucked" if self._stuck else driving.stuck_state,
            viewport_blocked=self._ctx.vetoed or driving.viewport_blocked,
            flags=self._dock.flags(),
            detected_rack=self._detected,
        )

    # -- the procedure -----------------------------------------------------------------------------------------------

    def _procedure(self) -> Steps:
        yield from self._glance()
        for _ in range(1 + self._retries):
            if not self._is_lined_up():
                yield from self._line_up()
            if (yield from self._drive_on()):
                return
            yield from self._back_out()
        raise self._dock.exhausted(1 + self._retries, self._why).about(self._blocker)

    def _glance(self) -> Steps:
        """What is seen from here already tells where the staging pose is."""
        begun = self._ctx.stamp
        while self._is_in_view() and not self._view.is_sure and self._since(begun) < GLANCE:
            yield Drive(STANDSTILL)

    def _line_up(self) -> Steps:
        """To before the dock, on its axis. Raises if it is not there."""
        for _ in range(ROUNDS):
            yield from self._drive_to_staging()
            yield from self._look()
            if self._is_lined_up():
                return

    def _drive_to_staging(self) -> Steps:
        """To the first of the staging poses that can be reached; the goal follows what is seen on the way."""
        failed: MoveFailed | None = None
        for distance in self._place.staging:
            self._staging_distance = distance
            try:
                while (yield from self._has_shifted()):
                    pass
                return
            except MoveFailed as unreachable:
                if unreachable.reason not in _NO_STAGING:
                    raise
                failed = failed or unreachable
            finally:
                self._drive = None
        assert failed is not None
        text = f"no pose to begin docking from can be reached: {failed.text}"
        raise MoveFailed(failed.reason, text, failed.evidence)

    def _has_shifted(self) -> Attempt:
        """Drive to the staging pose. True if, by what was seen on the way, it is elsewhere."""
        goal, was_sure = self._staging(), self._view.is_sure
        self._drive = DriveToPose(Goal(*goal.tolist()))
        while isinstance(outcome := self._drive.step(self._ctx), Drive):
            self._resumed = False
            yield outcome
            if self._is_lined_up():
                return False
            off = se2.between(goal, self._staging())
            if not was_sure and self._view.is_sure and (abs(off[:2]).max() > SHIFTED or abs(off[2]) > SHIFTED_YAW):
                return True
        return False

    def _look(self) -> Steps:
        begun = self._ctx.stamp
        while not self._view.is_sure:
            if self._resumed:
                begun, self._resumed = self._ctx.stamp, False
            if self._since(begun) > LOOK and self._ctx.seen is not None:
                raise self._dock.missing(self._ctx.seen, self._view.in_map(self._ctx))
            yield Drive(STANDSTILL)

    def _drive_on(self) -> Attempt:
        """Onto the dock. If False, ``_why`` says what failed."""
        self._dock.check_place(self._view.in_map(self._ctx))
        watch = RestWatch(self._ctx.stamp)
        while not docking.has_arrived(self._ahead(), self._place.direction):
            if (why := self._trouble(watch)) is not None:
                self._why = why
                return False
            if not self._view.is_sure or self._obstruction() is not None:
                yield Drive(STANDSTILL)
            else:
                ahead, place = self._ahead(), self._place
                yield Drive(docking.approach(ahead, place.direction, place.speed, self._ctx.settings))
        return (yield from self._settle())

    def _settle(self) -> Attempt:
        """Where driving ended: turn to the axis, then ask whether it is docked."""
        begun = self._ctx.stamp
        while self._view.unseen <= LOST_AFTER:
            if self._resumed:
                begun, self._resumed = self._ctx.stamp, False
            at, waited = self._at(), self._since(begun)
            if self._view.is_sure and is_still(self._ctx.twist):
                docked = self._dock.is_docked(self._ctx, at, waited)
                if docked is not None:
                    self._why = f"it ended {_off(at)}"
                    return docked
            turns = self._view.is_sure and abs(at[2]) > TURNED
            yield Drive(docking.turn_to_axis(self._ahead()) if turns else STANDSTILL)
        self._why = "the dock was no longer seen at the docked pose"
        return False

    def _back_out(self) -> Steps:
        """Straight back to before the dock. Raises 15 where that is blocked for too long."""
        watch = RestWatch(self._ctx.stamp)
        while (left := self._place.staging[0] - self._before()) > docking.STOP_WITHIN:
            if not self._place.funnel.wider().wider().holds(self._at(), self._place.direction):
                return  # it was set down elsewhere
            self._keep(watch, self._before())
            if (standing := watch.standing(self._ctx.stamp)) > PATIENCE:
                text = f"the way back from the dock is blocked for {standing:.0f} s, {left:.2f} m are left"
                raise MoveFailed(Reason.MOVE_TIMEOUT, text)
            place = self._place
            yield Drive(docking.along_axis(self._ahead(), -place.direction, left, place.speed, self._ctx.settings))

    # -- on the way --------------------------------------------------------------------------------------------------

    def _trouble(self, watch: RestWatch) -> str | None:
        """Why to give up this attempt."""
        at, before, ctx = self._at(), self._before(), self._ctx
        self._keep(watch, before)
        if self._view.unseen > LOST_AFTER:
            return f"the dock was no longer seen, {before:.2f} m before the docked pose"
        if self._view.is_sure and not self._place.funnel.wider().holds(at, self._place.direction):
            return f"too far off the axis: {_off(at)}"
        if (standing := watch.standing(ctx.stamp)) > PATIENCE:
            found = self._obstruction()
            self._blocker = None if found is None else self._seen(found)
            what = found.text if found is not None else _blocked(ctx)
            return f"no progress for {standing:.0f} s, {before:.2f} m before the docked pose: {what}"
        return None

    def _keep(self, watch: RestWatch, left: float) -> None:
        if self._resumed:
            watch.restart(self._ctx.stamp)
            self._resumed = False
        watch.update(self._ctx.stamp, left)
        self._stuck = watch.standing(self._ctx.stamp) > self._ctx.settings.stuck_after

    def _obstruction(self) -> Obstruction | None:
        seen = self._ctx.seen
        if seen is None:
            return None
        at = se2.between(self._view.in_chassis(self._ctx), ORIGIN)
        return self._dock.obstruction(self._view.points(seen), at)

    def _seen(self, found: Obstruction) -> Thing:
        x, y = se2.transformed(self._view.in_map(self._ctx), found.place[None])[0].round(3).tolist()
        return Thing(role="blocks", kind="observed obstacle", x=x, y=y)

    def _may_touch(self) -> tuple[Array, ...]:
        place = self._place
        if place.lane is None or self._drive is not None:
            return ()
        lane = se2.transformed(self._view.in_map(self._ctx), place.lane)
        return (lane,) if place.mapped is None else (lane, place.mapped)

    def _look_at_scan(self) -> None:
        self._detected = None
        seen = self._ctx.seen
        if seen is None or not self._view.is_new(seen) or not self._is_in_view():
            return
        found = self._view.take(seen, self._dock.look)
        self._place = self._dock.place(self._ctx)
        self._detected = self._dock.report(self._ctx, found, self._staging())

    # -- where things are --------------------------------------------------------------------------------------------

    def _at(self) -> Pose:
        """The chassis in the frame of the goal: of the docked pose."""
        goal = se2.compose(self._view.in_chassis(self._ctx), self._place.docked)
        return se2.between(goal, ORIGIN)

    def _ahead(self) -> Pose:
        """``_at`` when a command given now takes effect."""
        return se2.advanced(self._at(), self._ctx.twist, self._ctx.settings.actuation.latency)

    def _before(self) -> float:
        """Metres before the docked pose."""
        return float(-self._place.direction * self._at()[0])

    def _staging(self) -> Pose:
        """The staging pose in the map."""
        docked = se2.compose(self._view.in_map(self._ctx), self._place.docked)
        return se2.compose(docked, np.array([-self._place.direction * self._staging_distance, 0.0, 0.0]))

    def _is_lined_up(self) -> bool:
        """Whether it can drive straight onto the dock from here."""
        near = self._before() <= max(self._place.staging) + STRAIGHT_FROM
        return self._view.is_sure and near and self._place.funnel.holds(self._at(), self._place.direction)

    def _is_in_view(self) -> bool:
        away = self._view.in_chassis(self._ctx)
        return bool(abs(away[:2]).max() <= IN_VIEW)

    def _since(self, stamp: int) -> float:
        return (self._ctx.stamp - stamp) / NANOSECONDS


def _is_news(load: Load | None, known: Load) -> bool:
    """Whether a load must be told: it is kept on disk, and its pose wanders with that of the map."""
    return load is not None and load.state is not known.state


def _blocked(ctx: Context) -> str:
    return "blocked by an obstacle" if ctx.vetoed else "the wheels do not turn"


def _off(at: Pose) -> str:
    return f"{1e3 * at[0]:.0f} mm ahead, {1e3 * at[1]:.0f} mm to the left and {1e3 * at[2]:.0f} mrad off"
