"""Free room: a distance field with its place in the map, in which a body can be tried."""

from __future__ import annotations

from dataclasses import dataclass

from rackhand.services.planner.geometry import footprint as body
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.map.grid import Geometry, Mask
from rackhand.services.planner.planning.field import Field, distance_field, sample


@dataclass(frozen=True)
class DistanceGrid:
    """Distances in metres from cell centre to the nearest blocked cell centre, and where the cells lie."""

    distance: Field
    geometry: Geometry

    @staticmethod
    def of(blocked: Mask, geometry: Geometry) -> DistanceGrid:
        return DistanceGrid(distance_field(blocked, geometry.resolution), geometry)

    def at(self, x: float, y: float) -> float:
        """Metres from a point to the edge of the nearest blocked cell."""
        g = self.geometry
        return float(sample(self.distance, g.x, g.y, g.resolution, x, y)) - 0.5 * g.resolution

    def clearance(self, footprint: Footprint, pose: Pose, enough: float = 1.0) -> float:
        """Metres between the body at a pose and the nearest blocked cell's edge, exact below ``enough``."""
        g, f = self.geometry, footprint
        return body.clearance(
            self.distance, g.x, g.y, g.resolution, f.samples, f.circumscribed, pose[0], pose[1], pose[2], enough
        )

    def turn_clearance(self, footprint: Footprint, pose: Pose, turn: float, enough: float = 0.0) -> float:
        """The least clearance while turning on the spot by ``turn`` (signed), exact below ``enough``."""
        g, f = self.geometry, footprint
        return body.sweep_clearance(
            self.distance, g.x, g.y, g.resolution, f.samples, f.circumscribed, pose[0], pose[1], pose[2], turn, enough
        )
