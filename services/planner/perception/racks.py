"""Racks on the floor, wherever the scans have shown one: each is an obstacle as a whole, not only its legs.

A rack is searched among hits that neither the map nor a rack known already explains, so that it costs little where
nothing is new. It shows four legs, or two at a registered rack point while the others are hidden. A known one is
confirmed or removed by its legs' cells: beams hit them, or pass through them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.cells import Geometry, cells_in, cells_near
from rackhand.services.planner.geometry.polygon import inside_convex
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.load import Load, LoadState
from rackhand.services.planner.perception.clusters import small_clusters
from rackhand.services.planner.perception.observed import ObservedObstacles
from rackhand.services.planner.perception.partial_rack import racks_of_two_legs
from rackhand.services.planner.perception.rack_legs import find_rack, find_racks, leg_middles
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]
Cells = NDArray[np.int64]

SEARCH_EVERY, SEARCH_AT, CHECK_AT = 6, 0, 3  # scans: new racks are searched, and known ones checked, twice a second
EXPLAINED = 0.1  # m from a leg of a known rack, within which a hit is that leg
LEG_REACH = 0.1  # m around a leg's middle in which its cells are
FREE_SHARE = 0.8  # of a leg's cells, seen free, from which on the leg is gone
RECENT = 6  # scans that a cell's state counts as seen
SAME_RACK = 0.4  # m between the middles of two sightings of one rack
SIGHTINGS = 2  # after which a rack is believed in
GONE_CHECKS = 3  # in a row with three legs gone, after which it is not any more
MOVED = 0.05  # m off the known pose, from which on a sighting replaces it
BLEND = 0.2  # least weight of a newer sighting
RIM = 0.75  # share of the outline's size, within which cells are not at its rim
REDRAW = 0.015  # m or rad by which a pose must change for its cells to be computed anew


class RackView(NamedTuple):
    """One scan as racks are looked for in it. ``observed`` has just integrated it. ``sensor`` and ``chassis`` are the
    poses of lidar and chassis in the map then; ``outline`` is that of the chassis, (n, 2) in the map frame. ``places``:
    poses of the registered rack points."""

    observed: ObservedObstacles
    sensor: Pose
    chassis: Pose
    outline: Array
    load: Load
    specs: tuple[RackSpec, ...]
    stamp: int
    places: tuple[Pose, ...] = ()


class Legs(Enum):
    """What the last scans show of a rack's legs."""

    SEEN = "seen"
    GONE = "gone"
    HIDDEN = "hidden"


@dataclass
class KnownRack:
    """A rack on the floor: pose in the map frame, when it was seen last (ns), and the map's cells that it blocks and
    in which its legs are, leg by leg, as flat indices. ``rim``: middles of the outermost cells that it blocks, (n, 2).
    """

    pose: Pose
    spec: RackSpec
    stamp: int
    geometry: Geometry
    sightings: int = 1
    gone: int = 0
    cells: Cells = field(init=False)
    rim: Array = field(init=False)
    legs: list[Cells] = field(init=False)

    def __post_init__(self) -> None:
        self._draw()

    @property
    def outline(self) -> Array:
        """With its margins: corners (4, 2) in the map frame."""
        return se2.transformed(self.pose, self.spec.outline())

    @property
    def leg_middles(self) -> Array:
        """(4, 2) in the map frame."""
        return se2.transformed(self.pose, leg_middles(self.spec))

    @property
    def believed(self) -> bool:
        return self.sightings >= SIGHTINGS

    def see(self, pose: Pose, stamp: int) -> None:
        """Take another sighting."""
        self.stamp, self.sightings = stamp, self.sightings + 1
        away = math.hypot(pose[0] - self.pose[0], pose[1] - self.pose[1])
        weight = 1.0 if away > MOVED else max(BLEND, 1.0 / self.sightings)
        before, self.pose = self.pose, se2.interpolate(self.pose, _aligned(pose, self.pose, self.spec), weight)
        if np.abs(self.pose - before).max() > 1e-9 and np.abs(self.pose - self._drawn).max() > REDRAW:
            self._draw()

    def _draw(self) -> None:
        self._drawn = self.pose.copy()
        self.cells = cells_in(self.geometry, self.outline)
        centres = self.geometry.centres(self.cells)
        core = self.pose[:2] + RIM * (self.outline - self.pose[:2])
        self.rim = centres[~inside_convex(core, centres)]
        self.legs = [cells_near(self.geometry, leg, LEG_REACH) for leg in self.leg_middles]


class RackTracker:
    """``look`` at each scan; ``blocking`` are the racks that nothing may drive through."""

    def __init__(self, geometry: Geometry, settings: NavigationSettings) -> None:
        self._geometry, self._settings = geometry, settings
        self._racks: list[KnownRack] = []
        self._scans = 0
        self._next = 0
        self._above: KnownRack | None = None

    @property
    def racks(self) -> list[KnownRack]:
        """All that are believed in, that above the chassis too."""
        return [rack for rack in self._racks if rack.believed]

    @property
    def blocking(self) -> list[KnownRack]:
        """Without the one that the chassis is under."""
        return [rack for rack in self.racks if rack is not self._above]

    def near(self, x: float, y: float, radius: float) -> KnownRack | None:
        """The nearest rack whose middle is within ``radius`` metres of a place."""
        found = min(self.racks, key=lambda rack: math.hypot(rack.pose[0] - x, rack.pose[1] - y), default=None)
        return found if found is not None and math.hypot(found.pose[0] - x, found.pose[1] - y) <= radius else None

    def look(self, view: RackView) -> None:
        """Take a scan."""
        self._follow_load(view.load, view.chassis, view.stamp)
        self._scans += 1
        phase = self._scans % SEARCH_EVERY
        if phase == SEARCH_AT:
            self._search(view)
        elif phase == CHECK_AT:
            self._check(view)
            self._refine(view)

    # -- the rack of the chassis -------------------------------------------------------------------------------------

    def _follow_load(self, load: Load, chassis: Pose, stamp: int) -> None:
        """A rack that the chassis is under is where the load says; one that it carries is not on the floor."""
        self._above = None
        if load.spec is None or load.rack_pose is None:
            return
        pose = np.array(load.rack_pose)
        if load.state is LoadState.UNDER_RACK:
            self._above = self._at(pose)
            if self._above is None or self._above.spec != load.spec:
                self._racks = [rack for rack in self._racks if rack is not self._above]
                self._above = KnownRack(pose, load.spec, stamp, self._geometry, sightings=SIGHTINGS)
                self._racks.append(self._above)
            self._above.stamp = stamp
        elif load.state is LoadState.CARRYING:
            there = self._at(se2.compose(chassis, pose))
            self._racks = [rack for rack in self._racks if rack is not there]

    def _at(self, pose: Pose) -> KnownRack | None:
        close = [r for r in self._racks if math.hypot(r.pose[0] - pose[0], r.pose[1] - pose[1]) <= SAME_RACK]
        return min(close, key=lambda r: math.hypot(r.pose[0] - pose[0], r.pose[1] - pose[1]), default=None)

    # -- new ones ----------------------------------------------------------------------------------------------------

    def _search(self, view: RackView) -> None:
        points, stamp = self._unexplained(view.observed, view.sensor), view.stamp
        whole = find_racks(points, view.sensor, view.specs) if len(points) >= 4 else []
        for pose, spec in [*((seen.pose, seen.spec) for seen in whole), *self._partial(points, view)]:
            known = self._at(pose)
            if known is None:
                self._racks.append(KnownRack(pose, spec, stamp, self._geometry))
            elif known is not self._above and known.stamp != stamp:
                self._take(known, pose, spec, stamp)
        self._racks = [rack for rack in self._racks if rack.believed or stamp - rack.stamp < 2 * NANOSECONDS]

    def _partial(self, points: Array, view: RackView) -> list[tuple[Pose, RackSpec]]:
        """Racks at registered points of which two legs are seen, and the others neither seen nor seen to be gone."""
        places = [place for place in view.places if self._may_have_more(place, view)]
        if not places or len(points) < 2:
            return []
        clusters = small_clusters(points, view.sensor)
        found: list[tuple[Pose, RackSpec]] = []
        for place in places:
            seen = racks_of_two_legs(clusters, place, view.specs)
            found += islice((one for one in seen if self._may_be(*one, view.observed)), 1)
        return found

    def _may_be(self, pose: Pose, spec: RackSpec, observed: ObservedObstacles) -> bool:
        legs = (cells_near(self._geometry, leg, LEG_REACH) for leg in se2.transformed(pose, leg_middles(spec)))
        return Legs.GONE not in [leg_state(observed, cells) for cells in legs]

    def _may_have_more(self, place: Pose, view: RackView) -> bool:
        """Whether a rack may be at a place where none is believed in."""
        near = math.hypot(*(place[:2] - view.sensor[:2])) <= self._settings.rack_range
        known = self._at(place)
        return near and (known is None or not known.believed) and not inside_convex(view.outline, place[None, :2])[0]

    def _unexplained(self, observed: ObservedObstacles, sensor: Pose) -> Array:
        """Hits within range that are not on the map and no leg of a rack that is believed in."""
        points: Array = observed.points[observed.unmapped]
        points = points[np.hypot(*(points - sensor[:2]).T) <= self._settings.rack_range]
        legs = [rack.leg_middles for rack in self.racks]
        if len(points) and legs:
            away = np.hypot(*(points[:, None] - np.vstack(legs)[None]).transpose(2, 0, 1))
            points = points[away.min(axis=1) > EXPLAINED]
        return points

    def _take(self, known: KnownRack, pose: Pose, spec: RackSpec, stamp: int) -> None:
        if known.spec == spec:
            known.see(pose, stamp)
            return
        self._racks = [rack for rack in self._racks if rack is not known]
        self._racks.append(KnownRack(pose, spec, stamp, self._geometry, known.sightings))

    # -- known ones --------------------------------------------------------------------------------------------------

    def _check(self, view: RackView) -> None:
        stamp = view.stamp
        for rack in self.racks:
            if rack is self._above:
                continue
            legs = [leg_state(view.observed, cells) for cells in rack.legs] if self._in_range(rack, view.sensor) else []
            if legs.count(Legs.SEEN) >= 2:
                rack.stamp, rack.gone = stamp, 0
            elif legs.count(Legs.GONE) >= 3:
                rack.gone += 1
        memory = round(self._settings.rack_memory * NANOSECONDS)
        self._racks = [r for r in self._racks if r.gone < GONE_CHECKS and stamp - r.stamp < memory]

    def _refine(self, view: RackView) -> None:
        """Measure one of those in range anew, each in turn."""
        near = [rack for rack in self.blocking if self._in_range(rack, view.sensor)]
        if not near:
            return
        self._next = (self._next + 1) % len(near)
        rack = near[self._next]
        points = view.observed.points
        points = points[np.hypot(*(points - rack.pose[:2]).T) <= rack.spec.depth + rack.spec.width]
        if len(points) >= 4 and (found := find_rack(points, view.sensor, rack.pose, [rack.spec])) is not None:
            rack.see(found.pose, view.stamp)

    def _in_range(self, rack: KnownRack, sensor: Pose) -> bool:
        return math.hypot(rack.pose[0] - sensor[0], rack.pose[1] - sensor[1]) <= self._settings.rack_range


def leg_state(observed: ObservedObstacles, cells: Cells) -> Legs:
    """Whether the last scans hit something in those cells, or saw them free."""
    occupied, free = observed.survey(cells, RECENT)
    if occupied.any():
        return Legs.SEEN
    return Legs.GONE if free.size and free.mean() >= FREE_SHARE else Legs.HIDDEN


def _aligned(pose: Pose, known: Pose, spec: RackSpec) -> Pose:
    """The same rack with its heading as near to the known one as its symmetry allows."""
    quarter = math.pi / 2 if abs(spec.depth - spec.width) < 1e-6 else math.pi
    turns = round((known[2] - pose[2]) / quarter)
    return np.array([pose[0], pose[1], se2.wrap(pose[2] + turns * quarter)])
