"""Where a dock is, by what the scans showed of it.

Its pose is kept in the odometry frame, which is exact over the few metres of docking, while the chassis' pose in the
map wanders by centimetres.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rackhand.services.planner.behaviors.base import Array, Context
from rackhand.services.planner.control.docking import FusedPose
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.perception.seen_scan import SeenScan

SURE = 4  # sightings that make a pose sure
UNSURE_AFTER = 2  # scans in a row without a sighting, after which it is not sure any more

Look = Callable[[SeenScan, Pose], Pose | None]


class DockView:
    """``unseen`` counts scans in a row without a sighting. Before the first sighting the dock is where it should be."""

    def __init__(self, prior: Pose) -> None:
        """``prior``: the dock's pose in the map, as registered."""
        self._map = np.array(prior, dtype=np.float64)
        self._fused = FusedPose()
        self._stamp = -1
        self.unseen = 0

    @property
    def is_sure(self) -> bool:
        return self._fused.sightings >= SURE and self.unseen <= UNSURE_AFTER

    def is_new(self, seen: SeenScan) -> bool:
        return seen.stamp != self._stamp

    def take(self, seen: SeenScan, look: Look) -> Pose | None:
        """Look for the dock in a scan; its pose in the chassis frame at the scan, None if it is not seen."""
        self._stamp = seen.stamp
        fused = self._fused.pose
        prior = se2.between(seen.chassis, self._map) if fused is None else se2.between(seen.odometry, fused)
        found = look(seen, prior)
        if found is None:
            self.unseen += 1
        else:
            self.unseen = 0
            self._fused.update(se2.compose(seen.odometry, found))
            self._map = se2.compose(seen.chassis, found)
        return found

    def forget(self) -> None:
        """The chassis or the dock may have been moved: only the place in the map is kept."""
        self._fused = FusedPose()
        self.unseen = 0

    def in_chassis(self, ctx: Context) -> Pose:
        """The dock in the chassis frame now."""
        if self._fused.pose is None or ctx.state.odometry is None:
            return se2.between(ctx.pose, self._map)
        return se2.between(se2.pose(ctx.state.odometry.pose), self._fused.pose)

    def in_map(self, ctx: Context) -> Pose:
        return se2.compose(ctx.pose, self.in_chassis(ctx))

    def points(self, seen: SeenScan) -> Array:
        """The points of a scan in the dock's frame, (n, 2)."""
        fused = self._fused.pose
        dock = se2.between(seen.chassis, self._map) if fused is None else se2.between(seen.odometry, fused)
        return se2.transformed(se2.between(dock, np.zeros(3)), seen.points)
