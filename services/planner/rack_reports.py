"""What is published of racks on the floor: those that scans have shown, the rack points, and searches on request."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import NANOSECONDS, Pose2
from rackhand.schemas.maps import MapData
from rackhand.schemas.racks import DetectedRack, RackSpec, SeenRack, SeenRacks
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.perception.rack_legs import RackSighting, measure_racks
from rackhand.services.planner.perception.racks import RackTracker
from rackhand.services.planner.perception.seen_scan import SeenScan
from rackhand.services.planner.reports import Reports

Array = NDArray[np.float64]
SEARCH_NS = NANOSECONDS // 2  # between two searches on request
RANGE = 4.0  # m within which they look, from the chassis' origin
STAGING = 0.5  # m between the front of the chassis and the rack at the staging pose
QUARTER = math.pi / 2


class RackReports:
    """``searching``: whether a client has asked for racks to be measured, which is done while no move runs."""

    def __init__(self, reports: Reports) -> None:
        self._reports = reports
        self._last_search = 0
        self.searching = False

    def states(self, stamp: int, costmap: LocalCostmap | None, current: MapData | None) -> None:
        """Racks and rack points, as they are known now."""
        if costmap is None or current is None:
            return
        points = costmap.rack_points
        self._reports.rack_states(points.detected(stamp, current.uid), points.remembered(stamp, current.uid))
        self._reports.seen_racks(seen_racks(stamp, costmap.racks))

    def search(self, stamp: int, motion: Motion) -> None:
        """Measure the rack in front of the chassis, where that was asked for."""
        seen, footprint = motion.perception.seen, motion.footprint
        if not self.searching or seen is None or footprint is None:
            return
        if not 0 <= stamp - self._last_search < SEARCH_NS:
            self._last_search = stamp
            front = float(footprint.polygon[:, 0].max())
            self._reports.detected_rack(rack_ahead(seen, leg_size_of(motion.settings.rack_specs), front))


def seen_racks(stamp: int, tracker: RackTracker) -> SeenRacks:
    """The racks that are believed in, with their measured poses to the millimetre."""
    rows = [SeenRack(stamp=rack.stamp, pose=_rounded(rack.pose), spec=rack.spec) for rack in tracker.racks]
    return SeenRacks(stamp=stamp, racks=tuple(rows))


def rack_ahead(seen: SeenScan, leg_size: float, front: float) -> DetectedRack:
    """The rack of any size that is nearest before the chassis; ``front``: metres from its origin to its front edge."""
    found = [_ahead(rack) for rack in measure_racks(seen.points, seen.sensor, leg_size)]
    near = [rack for rack in found if rack.pose[0] > 0.0 and math.hypot(rack.pose[0], rack.pose[1]) <= RANGE]
    nearest = min(near, key=lambda rack: math.hypot(rack.pose[0], rack.pose[1]), default=None)
    if nearest is None:
        return DetectedRack(stamp=seen.stamp, detected=False)
    staging = se2.compose(nearest.pose, np.array([-0.5 * nearest.depth - STAGING - front, 0.0, 0.0]))
    return DetectedRack(
        stamp=seen.stamp,
        detected=True,
        pose=_rounded(se2.compose(seen.chassis, nearest.pose)),
        width=nearest.width,
        depth=nearest.depth,
        legs=se2.transformed(seen.chassis, nearest.legs),
        staging=_rounded(se2.compose(seen.chassis, staging)),
    )


def _ahead(rack: RackSighting) -> RackSighting:
    """The same rack with its heading as near to that of the chassis as its rectangle allows."""
    quarters = round(rack.pose[2] / QUARTER)
    pose = np.array([rack.pose[0], rack.pose[1], se2.wrap(rack.pose[2] - quarters * QUARTER)])
    width, depth = (rack.width, rack.depth) if quarters % 2 == 0 else (rack.depth, rack.width)
    return rack._replace(pose=pose, width=width, depth=depth)


def leg_size_of(specs: tuple[RackSpec, ...]) -> float:
    """The leg size that a rack of unknown kind is measured with."""
    return specs[0].leg_size if specs else 0.03


def _rounded(pose: Pose) -> Pose2:
    return Pose2(x=round(float(pose[0]), 3), y=round(float(pose[1]), 3), yaw=round(float(pose[2]), 4))
