"""``align_with_rack``: crawl under the rack at a rack point, and centre there.

Why such a move fails, and when. The reasons of ``standard`` apply on the way to the staging pose.

==== =========================== ======================================================================================
  #  reason                      raised
==== =========================== ======================================================================================
500  invalid_rack_detection_pos  at start: the target is no rack point of the map (within ``rack_point_radius``), or
                                 ``properties.rack_layer`` is no level of the area that the point is in
501  rack_detection_error        at the staging pose: no rack is seen at the point, it has the size of no
                                 ``rack.specs``, or it is farther than 0.2 m or 15° off the point
502  rack_retry_count_exceeded   no attempt to drive under it succeeded; each of them backs out and begins anew
506  jack_in_up_state            at start: the jack is not all the way down
==== =========================== ======================================================================================

Without ``target_ori`` the chassis is under the rack at the docking heading of the rack point. A chassis that is under
that rack already is only centred. With ``route_coordinates`` that route is driven first, as by a standard move.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rackhand.schemas.explain import Measure, Thing
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.maps import PointType, RegionType
from rackhand.schemas.moves import MoveCreate, PlanningFlag
from rackhand.schemas.racks import DetectedRack, RackSpec
from rackhand.services.planner.behaviors.approach import route_first
from rackhand.services.planner.behaviors.base import Array, Behavior, Context
from rackhand.services.planner.behaviors.docking import Docking, Obstruction, Place
from rackhand.services.planner.control.docking import Funnel
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.polygon import convex_overlap
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.jacking import REACHED, jack_height
from rackhand.services.planner.load import Load
from rackhand.services.planner.map.overlays import MapOverlays, PointOfInterest
from rackhand.services.planner.perception.rack_legs import RackSighting, describe_miss, find_rack
from rackhand.services.planner.perception.seen_scan import SeenScan

RETRIES = 2
MOST_OFF, MOST_TURNED = 0.2, math.radians(15)  # of a rack off its point
SAME_RACK = 0.1  # m more, by which a rack above the chassis is off, to be the one at the point
SPEED = 0.4  # m/s under the rack
STAGING = (0.45, 0.3, 0.7)  # m between the front of the chassis and the rack
BESIDE_LEGS = 0.06  # m beside the legs: hits nearer to them are theirs
INSIDE = 0.03  # m that the body overlaps the rectangle of the legs when it counts as under the rack
AT_REST = 0.4  # s over which the pose under the rack is measured
TURNING = 3.0  # s for the last turn
CENTRED, CENTRED_ALONG, CENTRED_YAW = 0.01, 0.015, 0.01  # m and rad off the docked pose
FEWEST_HITS = 2  # of an obstruction


@dataclass(frozen=True)
class RackTarget:
    """A rack point and the heading under the rack there. ``layer`` as requested."""

    point: PointOfInterest
    yaw: float
    layer: int | None = None

    @property
    def pose(self) -> Pose:
        return np.array([self.point.x, self.point.y, self.yaw])

    def expected(self) -> Thing:
        """The point, as where the rack should be."""
        point = self.point
        return Thing(role="expected", kind="rack point", name=point.name or point.id, x=point.x, y=point.y)

    def __str__(self) -> str:
        return f"rack point {self.point.name or self.point.id!r} ({self.point.x:.2f}, {self.point.y:.2f})"


def for_request(request: MoveCreate) -> Behavior:
    return align_with_rack(request)


def align_with_rack(request: MoveCreate, target: RackTarget | None = None) -> Behavior:
    """``target``: in place of the request's. Raises ``MoveFailed(INVALID_TRACK_POINTS)``."""
    dock = RackDock(request, target)
    return route_first(request, Docking(dock, RETRIES), dock.begin)


def target_of(request: MoveCreate, overlays: MapOverlays, radius: float) -> RackTarget:
    """The rack point that a request means; raises ``MoveFailed`` (500)."""
    if request.target_x is None or request.target_y is None:
        raise MoveFailed(Reason.INVALID_RACK_DETECTION_POS, "align_with_rack needs target_x and target_y")
    x, y = request.target_x, request.target_y
    nearest = overlays.nearest_point(PointType.RACK, x, y)
    if nearest is None:
        text = f"the target is ({x:.2f}, {y:.2f}), and the map has no rack points"
        raise MoveFailed(Reason.INVALID_RACK_DETECTION_POS, text)
    away = math.hypot(nearest.x - x, nearest.y - y)
    if away > radius:
        name = nearest.name or nearest.id
        off = Measure(name="distance to the nearest rack point", value=round(away, 3), expected=radius, unit="m")
        raise MoveFailed(
            Reason.INVALID_RACK_DETECTION_POS,
            f"the target ({x:.2f}, {y:.2f}) is no rack point; the nearest is {name!r} at ({nearest.x:.2f}, "
            f"{nearest.y:.2f}), {away:.2f} m away, want at most {radius:.2f} m",
        ).about(Thing(role="seen", kind="rack point", name=name, x=nearest.x, y=nearest.y), measures=(off,))
    yaw = nearest.dock_yaw or 0.0 if request.target_ori is None else request.target_ori
    return RackTarget(nearest, yaw, checked_layer(request.properties.get("rack_layer"), nearest, overlays))


def checked_layer(layer: Any, point: PointOfInterest, overlays: MapOverlays) -> int | None:
    """``properties.rack_layer``: an index into the levels of the area that the point is in; 0 is the floor, which every
    point has. Raises ``MoveFailed`` (500)."""
    if layer is None:
        return None
    area = next((zone for zone in overlays.zones_of(RegionType.RACK_ZONE) if zone.contains(point.x, point.y)), None)
    levels = area.properties.get("rackLevels") if area is not None else None
    known = max(len(levels) if isinstance(levels, list) else 0, 1)
    if isinstance(layer, bool) or not isinstance(layer, int) or not 0 <= layer < known:
        where = "outside of rack areas" if area is None else f"in rack area {area.name or area.id!r}"
        text = f"properties.rack_layer is {layer!r}; rack point {point.name or point.id!r}, {where}, has {known} levels"
        raise MoveFailed(Reason.INVALID_RACK_DETECTION_POS, f"{text}: want 0 to {known - 1}")
    return layer


def check_jack_down(ctx: Context) -> None:
    """Raises ``MoveFailed`` (506) unless the jack is all the way down."""
    jack = ctx.state.jack
    if jack is not None and jack.progress > REACHED:
        text = f"the jack is at {jack.progress:.0%}, want 0 %: call jack_down and wait until it has arrived"
        raise MoveFailed(Reason.JACK_IN_UP_STATE, text).about(measures=(jack_height(jack.progress),))


class RackDock:
    """The rack at a rack point, as something to dock to. Its frame is that of ``RackSpec``, so the docked pose is ahead
    of the rack's middle, at most."""

    intent = "aligning_with_rack"

    _target: RackTarget
    _specs: tuple[RackSpec, ...]
    _spec: RackSpec  # of the rack that was seen last

    def __init__(self, request: MoveCreate, target: RackTarget | None = None) -> None:
        self._request = request
        self._chosen = target
        self._sighting: RackSighting | None = None

    def flags(self) -> frozenset[PlanningFlag]:
        return frozenset({"aligning_with_rack"})

    def begin(self, ctx: Context) -> None:
        overlays = ctx.costmap.static.overlays
        self._target = self._chosen or target_of(self._request, overlays, ctx.settings.rack_point_radius)
        check_jack_down(ctx)
        self._spec, *_ = self._specs = ctx.settings.rack_specs or (ctx.settings.unmeasured_rack,)

    def stays_docked(self, ctx: Context) -> bool:
        try:
            self.begin(ctx)
        except MoveFailed:
            return True
        rack = ctx.load.rack_pose
        return rack is not None and math.hypot(*(self._target.pose - rack)[:2]) <= MOST_OFF + SAME_RACK

    def place(self, ctx: Context) -> Place:
        spec = self._spec
        front = float(ctx.footprint.polygon[:, 0].max())
        ahead = 0.0 if spec.alignment == "center" else spec.depth / 2 - spec.alignment_margin_back - front
        entry = spec.depth / 2 + front + ahead
        return Place(
            prior=self._target.pose,
            docked=np.array([ahead, 0.0, 0.0]),
            direction=1,
            staging=tuple(entry + gap for gap in STAGING),
            funnel=Funnel(entry),
            speed=SPEED,
            lane=_between_the_legs(spec),
        )

    def look(self, seen: SeenScan, prior: Pose) -> Pose | None:
        self._sighting = find_rack(seen.points, seen.sensor, prior, self._specs)
        if self._sighting is None:
            return None
        self._spec = self._sighting.spec
        return self._sighting.pose

    def report(self, ctx: Context, found: Pose | None, staging: Pose) -> DetectedRack | None:
        seen, sighting = ctx.seen, self._sighting
        if seen is None or sighting is None or found is None:
            return DetectedRack(stamp=ctx.stamp, detected=False)
        rack = sighting.moved(seen.chassis)
        return DetectedRack(
            stamp=seen.stamp,
            detected=True,
            pose=se2.message(rack.pose),
            width=rack.width,
            depth=rack.depth,
            legs=rack.legs,
            staging=se2.message(staging),
        )

    def missing(self, seen: SeenScan, dock: Pose) -> MoveFailed:
        sensor = se2.compose(seen.chassis, seen.sensor)
        miss = describe_miss(seen.in_map, sensor, dock, self._specs)
        failed = MoveFailed(Reason.RACK_DETECTION_ERROR, f"{miss.text}; at {self._target}")
        return failed.about(*miss.things, measures=miss.measures)

    def check_place(self, dock: Pose) -> None:
        off = se2.between(self._target.pose, dock)
        away, turned = math.hypot(off[0], off[1]), abs(off[2])
        if away > MOST_OFF or turned > MOST_TURNED:
            x, y = dock[:2].round(3).tolist()
            raise MoveFailed(
                Reason.RACK_DETECTION_ERROR,
                f"the rack is {away:.2f} m and {math.degrees(turned):.1f} degrees off {self._target}; want at most "
                f"{MOST_OFF:.2f} m and {math.degrees(MOST_TURNED):.0f} degrees",
            ).about(
                Thing(role="seen", kind="rack", x=x, y=y),
                self._target.expected(),
                measures=(
                    Measure(
                        name="distance of the rack from its point", value=round(away, 3), expected=MOST_OFF, unit="m"
                    ),
                    Measure(name="rack turned by", value=round(turned, 3), expected=round(MOST_TURNED, 3), unit="rad"),
                ),
            )

    def obstruction(self, points: Array, at: Pose) -> Obstruction | None:
        """Hits under the rack, before the chassis and beside neither row of legs."""
        spec = self._spec
        lane = spec.width / 2 - spec.leg_size - BESIDE_LEGS
        x, half = points[:, 0], spec.depth / 2
        inside = (np.abs(points[:, 1]) < lane) & (x > max(at[0], -half)) & (x < half)
        if inside.sum() < FEWEST_HITS:
            return None
        place = points[inside].mean(axis=0)
        ahead, left = place
        text = f"an obstacle under the rack, {ahead:+.2f} m ahead of its middle and {left:+.2f} m to the left"
        return Obstruction(text, place)

    def load(self, body: Array, dock: Pose) -> Load | None:
        spec = self._spec
        half = 0.5 * np.array([spec.depth, spec.width]) - INSIDE
        legs = se2.transformed(dock, half * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]))
        return Load.under(spec, dock) if convex_overlap(body, legs) else None

    def is_docked(self, ctx: Context, off: Pose, waited: float) -> bool | None:
        del ctx
        ahead, left, turned = (abs(float(value)) for value in off)
        centred = ahead <= CENTRED_ALONG and left <= CENTRED
        if waited < AT_REST or (centred and turned > CENTRED_YAW and waited < TURNING):
            return None
        return centred and turned <= CENTRED_YAW

    def exhausted(self, attempts: int, why: str) -> MoveFailed:
        text = f"no success in {attempts} attempts to drive under the rack at {self._target}; the last one: {why}"
        tried = Measure(name="attempts without success", value=attempts, expected=0)
        return MoveFailed(Reason.RACK_RETRY_COUNT_EXCEEDED, text).about(measures=(tried,))


def _between_the_legs(spec: RackSpec) -> Array:
    """The lane under the rack, (4, 2) in the rack's frame."""
    length, half = spec.depth / 2, spec.width / 2 - spec.leg_size
    return np.array([(length, half), (-length, half), (-length, -half), (length, -half)])
