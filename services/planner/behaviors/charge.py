"""``charge``: drive onto the contacts of a charger, with the side of the chassis that has its own.

Why such a move fails, and when. The reasons of ``standard`` apply on the way to the staging pose.

==== =========================== ======================================================================================
  #  reason                      raised
==== =========================== ======================================================================================
100  charge_retry_count_exceeded ``charge_retry_count`` more attempts did not bring the contacts together
101  charge_dock_detection_error at the staging pose: no dock is seen near its registered pose
102  charge_dock_signal_error    as 100, where no retries were requested
103  invalid_charge_dock         at start: no charger (overlay type 9) is registered within 1 m of the target, or on the
                                 map at all; or the chassis has no charging contacts
104  already_in_charging         at start: it is charging
105  no_charge_current           the contacts met, and no current flowed for 10 s
506  jack_in_up_state            at start: the jack is not all the way down
==== =========================== ======================================================================================

Without a target it is the charger of the map nearest to the chassis. With ``route_coordinates`` that route is driven
first, as by a standard move.
"""

from __future__ import annotations

import math

import numpy as np

from rackhand.schemas.explain import Measure, Role, Thing
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.maps import PointType
from rackhand.schemas.moves import MoveCreate, PlanningFlag
from rackhand.schemas.racks import DetectedRack
from rackhand.services.planner.behaviors.align_with_rack import check_jack_down
from rackhand.services.planner.behaviors.approach import route_first
from rackhand.services.planner.behaviors.base import Array, Behavior, Context
from rackhand.services.planner.behaviors.docking import Docking, Obstruction, Place
from rackhand.services.planner.control.docking import Funnel
from rackhand.services.planner.errors import MoveFailed, elapsed
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.load import Load, LoadState
from rackhand.services.planner.map.overlays import MapOverlays, PointOfInterest
from rackhand.services.planner.perception.charger_dock import DockShape, describe_miss, find_dock
from rackhand.services.planner.perception.seen_scan import SeenScan

REGISTERED_WITHIN = 1.0  # m from a target to the charger that it means
STAGING = (0.7, 0.55, 0.9)  # m before the docked pose
SPEED = 0.2  # m/s onto the contacts
FUNNEL = Funnel(entry=0.1, aside=0.012, slope=0.15, turned=0.3, turned_inside=0.1)
CONTACT_PATIENCE, CURRENT_PATIENCE = 3.0, 10.0  # s at the docked pose
SIZE = 0.45  # m to each side of the middle of the dock, where it is on the map
BESIDE = 0.3  # m to each side of the axis: hits farther out are not in the way
FEWEST_HITS = 3
TIP_NOISE = 0.08  # m before the tips of the dock: hits nearer to them are theirs


def for_request(request: MoveCreate) -> Behavior:
    """Raises ``MoveFailed(INVALID_TRACK_POINTS)``."""
    dock = ChargerDock(request)
    return route_first(request, Docking(dock, request.charge_retry_count), dock.begin)


def target_of(request: MoveCreate, overlays: MapOverlays, chassis: Pose) -> PointOfInterest:
    """The charger that a request means; raises ``MoveFailed`` (103)."""
    given = request.target_x is not None and request.target_y is not None
    x, y = (request.target_x, request.target_y) if given else (float(chassis[0]), float(chassis[1]))
    assert x is not None and y is not None
    nearest = overlays.nearest_point(PointType.CHARGER, x, y)
    if nearest is None:
        raise MoveFailed(Reason.INVALID_CHARGE_DOCK, "no charger is registered on the map")
    away = math.hypot(nearest.x - x, nearest.y - y)
    if given and away > REGISTERED_WITHIN:
        off = Measure(name="distance to the charger", value=round(away, 3), expected=REGISTERED_WITHIN, unit="m")
        raise MoveFailed(
            Reason.INVALID_CHARGE_DOCK,
            f"no charger is registered within {REGISTERED_WITHIN:.1f} m of the target ({x:.2f}, {y:.2f}); the nearest "
            f"is {nearest.name or nearest.id!r} at ({nearest.x:.2f}, {nearest.y:.2f}), {away:.2f} m away",
        ).about(_charger("seen", nearest), measures=(off,))
    return nearest


class ChargerDock:
    """A charger, as something to dock to."""

    intent = "going_back_to_charger"
    _point: PointOfInterest

    def __init__(self, request: MoveCreate, shape: DockShape | None = None) -> None:
        self._request = request
        self._shape = shape or DockShape()
        self._touched: float | None = None
        self._waiting = False

    def flags(self) -> frozenset[PlanningFlag]:
        return frozenset({"waiting_for_charge"}) if self._waiting else frozenset()

    def begin(self, ctx: Context) -> None:
        battery, model = ctx.state.battery, ctx.state.model
        if battery is not None and battery.charging:
            raise MoveFailed(Reason.ALREADY_IN_CHARGING, f"the battery is charging, at {battery.percentage:.0%}")
        if model is None or model.charge_contact == "none":
            raise MoveFailed(Reason.INVALID_CHARGE_DOCK, "the chassis has no charging contacts")
        check_jack_down(ctx)
        self._point = target_of(self._request, ctx.costmap.static.overlays, ctx.pose)

    def stays_docked(self, ctx: Context) -> bool:
        """Off its contacts it docks anew; off those of a charger that gives no current, too. Before the first report of
        the battery, as after a restart, whether it charges is not known: it stays and asks again on the contacts."""
        try:
            self.begin(ctx)
        except MoveFailed:
            return ctx.load.state is LoadState.DOCKED
        return ctx.load.state is LoadState.DOCKED and ctx.state.battery is None

    def place(self, ctx: Context) -> Place:
        model = ctx.state.model
        backward = model is None or model.charge_contact == "back"
        prior = np.array([self._point.x, self._point.y, self._point.yaw or 0.0])
        behind = np.array([(0.0, SIZE), (-2.0 * SIZE, SIZE), (-2.0 * SIZE, -SIZE), (0.0, -SIZE)])
        around = behind - np.array([self._shape.apex - SIZE, 0.0])
        return Place(
            prior=prior,
            docked=np.array([0.0, 0.0, 0.0 if backward else math.pi]),
            direction=-1 if backward else 1,
            staging=STAGING,
            funnel=FUNNEL,
            speed=SPEED,
            lane=around,
            mapped=se2.transformed(prior, around),
        )

    def look(self, seen: SeenScan, prior: Pose) -> Pose | None:
        found = find_dock(seen.points, seen.sensor, prior, self._shape)
        return None if found is None else found.pose

    def report(self, ctx: Context, found: Pose | None, staging: Pose) -> DetectedRack | None:
        del ctx, found, staging
        return None

    def missing(self, seen: SeenScan, dock: Pose) -> MoveFailed:
        sensor = se2.compose(seen.chassis, seen.sensor)
        miss = describe_miss(seen.in_map, sensor, dock, self._shape)
        failed = MoveFailed(Reason.CHARGE_DOCK_DETECTION_ERROR, f"{miss.text}; at charger {self._name}")
        return failed.about(*miss.things, _charger("expected", self._point), measures=miss.measures)

    def check_place(self, dock: Pose) -> None:
        """What is looked for is near its place already."""

    def obstruction(self, points: Array, at: Pose) -> Obstruction | None:
        """Hits between the chassis and the tips of the dock."""
        tips = self._shape.tip[0] - self._shape.apex + TIP_NOISE
        inside = (np.abs(points[:, 1]) < BESIDE) & (points[:, 0] > tips) & (points[:, 0] < at[0])
        if inside.sum() < FEWEST_HITS:
            return None
        place = points[inside].mean(axis=0)
        ahead, left = place
        text = f"an obstacle before the charger, {ahead - at[0]:+.2f} m from the chassis and {left:+.2f} m to the left"
        return Obstruction(text, place)

    def load(self, body: Array, dock: Pose) -> Load | None:
        """The contacts tell."""
        del body, dock
        return None

    def is_docked(self, ctx: Context, off: Pose, waited: float) -> bool | None:
        """Charging, or touching without a current for too long (105), or not touching."""
        del off
        battery, contacts = ctx.state.battery, ctx.state.contacts
        if battery is not None and battery.charging:
            self._waiting = False
            return True
        if contacts is None or not contacts.charge_contact:
            self._touched, self._waiting = None, False
            return None if waited < CONTACT_PATIENCE else False
        self._waiting = True
        if self._touched is None:
            self._touched = waited
        if waited - self._touched > CURRENT_PATIENCE:
            text = f"the contacts meet those of charger {self._name}; no current flowed for {CURRENT_PATIENCE:.0f} s"
            flowed = elapsed("time without current", waited - self._touched, CURRENT_PATIENCE)
            raise MoveFailed(Reason.NO_CHARGE_CURRENT, text).about(_charger("seen", self._point), measures=(flowed,))
        return None

    def exhausted(self, attempts: int, why: str) -> MoveFailed:
        text = f"the contacts did not meet those of charger {self._name} in {attempts} attempts; the last one: {why}"
        reason = Reason.CHARGE_RETRY_COUNT_EXCEEDED if attempts > 1 else Reason.CHARGE_DOCK_SIGNAL_ERROR
        tried = Measure(name="attempts without contact", value=attempts, expected=0)
        return MoveFailed(reason, text).about(_charger("seen", self._point), measures=(tried,))

    @property
    def _name(self) -> str:
        return repr(self._point.name or self._point.id)


def _charger(role: Role, point: PointOfInterest) -> Thing:
    """The charger at its place on the map."""
    return Thing(role=role, kind="charger", name=point.name or point.id, x=point.x, y=point.y)
