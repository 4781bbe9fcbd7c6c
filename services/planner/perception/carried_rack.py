"""Where the rack is on the jack: its legs in the scan, in the chassis frame, compared with where they were after
lifting."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.explain import Measure
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.polygon import inside_convex
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.load import Load, LoadState, Slip
from rackhand.services.planner.perception.rack_legs import find_rack, leg_middles
from rackhand.services.planner.perception.seen_scan import SeenScan
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]

EVERY = 2  # scans: measured 6 times a second
LIFTED_FROM = 5  # measurements whose median is where the rack is after lifting
COMPARED = 3  # measurements whose median is where it is now
TAKEN = 0.01  # m or rad by which a measured pose of a rack that slipped must differ to be taken
LEG_REACH = 0.08  # m from the middle of a leg, within which a hit is that leg
BODY_REACH = 0.02  # m around the body within which a hit is the body
WITNESSES = 3  # hits under the rack from which on something is there


class Moved(NamedTuple):
    """In words and as evidence."""

    text: str
    measures: tuple[Measure, ...]


class Outcome(NamedTuple):
    """The load by now, and what to tell about a rack that has just moved significantly."""

    load: Load
    moved: Moved | None = None


class CarriedRack:
    """``look`` once a tick. A rack of a kind that was not known before is measured as whatever kind fits."""

    def __init__(self) -> None:
        self._stamp = -1
        self._scans = 0
        self._measured: deque[Pose] = deque(maxlen=LIFTED_FROM)

    def forget(self) -> None:
        """Another rack, or none."""
        self._stamp = -1
        self._measured.clear()

    def look(self, load: Load, seen: SeenScan | None, s: NavigationSettings) -> Outcome:
        """Take the newest scan. The same load where nothing changed."""
        if load.state is not LoadState.CARRYING or load.spec is None or load.rack_pose is None:
            self.forget()
            return Outcome(load)
        if seen is None or seen.stamp == self._stamp:
            return Outcome(load)
        self._stamp, self._scans = seen.stamp, self._scans + 1
        if self._scans % EVERY:
            return Outcome(load)
        specs = s.rack_specs if load.lifted_pose is None else (load.spec,)
        prior = self._measured[-1] if self._measured else np.array(load.rack_pose)
        found = find_rack(_around(seen.points, prior, load.spec), seen.sensor, prior, specs)
        if found is None:
            return Outcome(load)
        self._measured.append(found.pose)
        return self._compared(load, found.spec, s)

    def _compared(self, load: Load, spec: RackSpec, s: NavigationSettings) -> Outcome:
        if load.lifted_pose is None:
            if len(self._measured) < LIFTED_FROM:
                return Outcome(load)
            pose = se2.as_tuple(_median(self._measured))
            return Outcome(load.model_copy(update={"spec": spec, "rack_pose": pose, "lifted_pose": pose}))
        if len(self._measured) < COMPARED:
            return Outcome(load)
        now = _median(list(self._measured)[-COMPARED:])
        away, turned = _difference(now, np.array(load.lifted_pose))
        if away > s.rack_moved_far or turned > s.rack_turned_far:
            pose = se2.as_tuple(now)
            update = {"rack_pose": pose, "lifted_pose": pose, "slipped": Slip.SIGNIFICANTLY}
            self._measured.clear()
            return Outcome(load.model_copy(update=update), _moved(away, turned, s))
        if away <= s.rack_moved_slightly and turned <= s.rack_turned_slightly:
            return Outcome(load)
        update = {"slipped": Slip.SLIGHTLY} if load.slipped is Slip.NONE else {}
        if max(*_difference(now, np.array(load.rack_pose))) > TAKEN:
            update["rack_pose"] = se2.as_tuple(now)
        return Outcome(load.model_copy(update=update) if update else load)


def objects_under(load: Load, seen: SeenScan, body: Footprint) -> Array:
    """Hits under the carried rack that are neither its legs nor the body, (n, 2) in the chassis frame."""
    if load.spec is None or load.rack_pose is None:
        return np.empty((0, 2))
    points: Array = seen.points[inside_convex(load.rack, seen.points)]
    legs = se2.transformed(np.array(load.rack_pose), leg_middles(load.spec))
    off_legs = np.hypot(*(points[:, None] - legs[None]).transpose(2, 0, 1)).min(axis=1) > LEG_REACH
    off_body = (points @ body.edges[:, :2].T > body.edges[:, 2] + BODY_REACH).any(axis=1)
    found: Array = points[off_legs & off_body]
    return found


def _around(points: Array, rack: Pose, spec: RackSpec) -> Array:
    """Points that its legs can be."""
    reach = 0.5 * math.hypot(spec.depth, spec.width) + 0.5
    kept: Array = points[np.hypot(*(points - rack[:2]).T) <= reach]
    return kept


def _median(poses: deque[Pose] | list[Pose]) -> Pose:
    """Value by value; yaw about the first one's."""
    rows: Array = np.array(poses)
    rows[:, 2] = rows[0, 2] + np.array([se2.wrap(yaw - rows[0, 2]) for yaw in rows[:, 2]])
    middle: Pose = np.median(rows, axis=0)
    return middle


def _difference(a: Pose, b: Pose) -> tuple[float, float]:
    """Metres and radians between two poses."""
    return math.hypot(a[0] - b[0], a[1] - b[1]), abs(se2.wrap(a[2] - b[2]))


def _moved(away: float, turned: float, s: NavigationSettings) -> Moved:
    text = (
        f"the rack moved on the jack by {away:.3f} m and {math.degrees(turned):.1f} degrees since it was lifted; at "
        f"most {s.rack_moved_far:.2f} m and {math.degrees(s.rack_turned_far):.0f} degrees are allowed"
    )
    slid = Measure(name="the rack moved by", value=round(away, 3), expected=s.rack_moved_far, unit="m")
    wound = Measure(name="the rack turned by", value=round(turned, 3), expected=round(s.rack_turned_far, 3), unit="rad")
    return Moved(text, (slid, wound))
