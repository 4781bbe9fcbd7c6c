"""Before a move that begins under a rack or on a charger: drive straight out.

The way out is the one the chassis came: back from under a rack, away from a charger. From under a rack it is the other
way where that one is blocked. Where both are, it waits, and after ``move_timeout`` the move fails with 15.

A rack that is lifted is taken along, so nothing is undocked then. A jack that stopped on its way with a rack on it, or
that is up without a load under a rack, fails the move with 506: the move would drag or push the rack along.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import MoveCreate
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.behaviors.base import Array, Behavior, Context, Done, Drive, Status
from rackhand.services.planner.behaviors.dock_view import DockView
from rackhand.services.planner.behaviors.straight_out import BESIDE, straight_free
from rackhand.services.planner.control import docking
from rackhand.services.planner.control.progress_checker import RestWatch
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import STANDSTILL, Pose, wrap
from rackhand.services.planner.jacking import REACHED, jack_height
from rackhand.services.planner.load import Load, LoadState
from rackhand.services.planner.perception.rack_legs import find_rack
from rackhand.services.planner.perception.seen_scan import SeenScan

ROOM_TO_TURN = 0.06  # m between the rack and the circle that the chassis turns in
JUST_OUT = 0.03  # m between the rack and the body, where there is no room for more
OFF_CHARGER, JUST_OFF_CHARGER = 0.6, 0.15  # m
SPEED = 0.3  # m/s
KEEP = 0.08  # m before an obstacle
ANOTHER_WAY_AFTER = 2.0  # s of being blocked
OUT_OF = {LoadState.UNDER_RACK: "from under the rack", LoadState.DOCKED: "off the charger"}
STAYS = frozenset({"to_unload_point"})  # needs a rack on the jack, and fails before it moves


@runtime_checkable
class StaysDocked(Protocol):
    """A behaviour that may begin where the chassis is docked."""

    def stays_docked(self, ctx: Context) -> bool:
        """Whether it does."""


def undocking(ctx: Context, request: MoveCreate, behavior: Behavior) -> Undock | None:
    """What must happen before ``behavior`` begins; None for nothing. Raises ``MoveFailed`` (506)."""
    if request.type in STAYS:
        return None
    jack = ctx.state.jack
    if ctx.load.state is LoadState.CARRYING and jack is not None and jack.progress < 1.0 - REACHED:
        text = (
            f"the jack is at {jack.progress:.0%} with a rack on it: call jack_up to carry it, or jack_down to leave it"
        )
        raise MoveFailed(Reason.JACK_IN_UP_STATE, text).about(measures=(jack_height(jack.progress),))
    if ctx.load.state not in OUT_OF:
        return None
    if isinstance(behavior, StaysDocked) and behavior.stays_docked(ctx):
        return None
    if ctx.load.state is LoadState.UNDER_RACK and jack is not None and jack.progress > REACHED:
        text = f"the jack is at {jack.progress:.0%} under a rack that is not on it: call jack_down, then move"
        raise MoveFailed(Reason.JACK_IN_UP_STATE, text).about(measures=(jack_height(jack.progress),))
    return Undock(ctx)


@dataclass(frozen=True)
class _Way:
    """A way out: 1 forward or -1 backward, and metres from the middle of the dock to where it ends, at least and
    wanted."""

    direction: int
    least: float
    wanted: float


class Undock:
    """Drives out of the load that the chassis has when it is made."""

    def __init__(self, ctx: Context) -> None:
        load = ctx.load
        self._what = OUT_OF[load.state]
        self._spec = load.spec if load.state is LoadState.UNDER_RACK else None
        self._view = DockView(_axis(ctx))
        self._ways = _ways(ctx, self._spec)
        self._way = self._ways[0]
        self._watch = RestWatch(ctx.stamp)
        self._blocked_since: int | None = None
        self._stuck = False

    def step(self, ctx: Context) -> Drive | Done:
        if ctx.seen is not None and self._view.is_new(ctx.seen) and self._spec is not None:
            self._view.take(ctx.seen, self._look)
        at = se2.between(self._view.in_chassis(ctx), np.zeros(3))
        left, free = self._left(at), self._free(ctx, self._way.direction)
        if self._has_ended(left, free):
            return Done(Load() if self._spec is None and ctx.load.state is LoadState.UNDER_RACK else None)
        self._note_progress(ctx, at)
        go = min(left, free - KEEP)
        if go <= 0.0:
            self._consider_another_way(ctx, at)
            return Drive(STANDSTILL, self._may_touch(ctx))
        ahead = se2.advanced(at, ctx.twist, ctx.settings.actuation.latency)
        return Drive(docking.along_axis(ahead, self._way.direction, go, SPEED, ctx.settings), self._may_touch(ctx))

    def resume(self, ctx: Context) -> None:
        self._view.forget()
        self._watch.restart(ctx.stamp)
        self._blocked_since = None

    def status(self) -> Status:
        return Status(
            intent="undocking_charger_or_rack",
            stuck_state="move_stucked" if self._stuck else "none",
            flags=frozenset({"undocking_charger_or_rack"}),
        )

    def _look(self, seen: SeenScan, prior: Pose) -> Pose | None:
        assert self._spec is not None
        found = find_rack(seen.points, seen.sensor, prior, (self._spec,))
        return None if found is None else found.pose

    def _left(self, at: Pose) -> float:
        """Metres to where the way wanted ends."""
        return self._way.wanted - self._way.direction * float(at[0])

    def _has_ended(self, left: float, free: float) -> bool:
        """At the end, or out and no room for more."""
        short = left - (self._way.wanted - self._way.least)
        return left <= docking.STOP_WITHIN or (short <= 0.0 and free <= KEEP + docking.STOP_WITHIN)

    def _note_progress(self, ctx: Context, at: Pose) -> None:
        """Raises 15 when there has been none for too long."""
        if self._watch.update(ctx.stamp, float(at[0]), float(at[1])):
            self._blocked_since = None
        standing = self._watch.standing(ctx.stamp)
        self._stuck = standing > ctx.settings.stuck_after
        if standing > ctx.settings.move_timeout:
            ways = " and ".join("ahead" if way.direction > 0 else "behind" for way in self._ways)
            room = ", ".join(f"{max(self._free(ctx, way.direction), 0.0):.2f} m" for way in self._ways)
            text = f"the chassis cannot drive out {self._what}: no progress for {standing:.0f} s; free {ways}: {room}"
            raise MoveFailed(Reason.MOVE_TIMEOUT, text)

    def _consider_another_way(self, ctx: Context, at: Pose) -> None:
        if self._blocked_since is None:
            self._blocked_since = ctx.stamp
        if (ctx.stamp - self._blocked_since) / NANOSECONDS < ANOTHER_WAY_AFTER:
            return
        for way in self._ways:
            if self._free(ctx, way.direction) - KEEP >= way.least - way.direction * float(at[0]):
                self._way, self._blocked_since = way, None
                return

    def _free(self, ctx: Context, direction: int) -> float:
        return straight_free(ctx, direction, self._may_touch(ctx))

    def _may_touch(self, ctx: Context) -> tuple[Array, ...]:
        """The rack itself: its legs stay obstacles, its outline does not."""
        if self._spec is None:
            return ()
        half = self._spec.width / 2 - self._spec.leg_size - 2.0 * BESIDE
        lane = np.array([(0.1, half), (-0.1, half), (-0.1, -half), (0.1, -half)])
        return (se2.transformed(self._view.in_map(ctx), lane),)


def _axis(ctx: Context) -> Pose:
    """The dock in the map, with x along the chassis' heading as nearly as can be."""
    if ctx.load.state is not LoadState.UNDER_RACK or ctx.load.rack_pose is None:
        return ctx.pose
    rack = np.array(ctx.load.rack_pose)
    if abs(wrap(rack[2] - ctx.pose[2])) > math.pi / 2:
        rack[2] = wrap(rack[2] + math.pi)
    return rack


def _ways(ctx: Context, spec: RackSpec | None) -> tuple[_Way, ...]:
    """The one to take first, first."""
    body = ctx.footprint
    if ctx.load.state is LoadState.DOCKED:
        model = ctx.state.model
        direction = -1 if model is not None and model.charge_contact == "front" else 1
        return (_Way(direction, JUST_OFF_CHARGER, OFF_CHARGER),)
    size = spec or ctx.settings.unmeasured_rack
    ways = []
    for direction in (-1, 1):
        margin = size.margin[1] if direction < 0 else size.margin[0]
        edge = size.depth / 2 + margin
        own = float((-direction * body.polygon[:, 0]).max())
        ways.append(_Way(direction, edge + own + JUST_OUT, edge + body.circumscribed + ROOM_TO_TURN))
    return tuple(ways)
