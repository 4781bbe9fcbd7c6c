"""What is around the chassis now: the map, what is observed on it, and a distance field of the near part."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schemas.chassis import Scan
from services.planner.navigation.field import Field, distance_field
from services.planner.navigation.footprint import Footprint, clearance, sweep_clearance
from services.planner.navigation.grid import Geometry, Mask, StaticMap
from services.planner.navigation.observed import ObservedObstacles
from services.planner.navigation.safety import as_obstacles, nearby_cells
from services.planner.navigation.se2 import Pose
from services.planner.navigation.settings import NavigationSettings

Array = NDArray[np.float64]
WINDOW = 5.5  # m to each side


class Surroundings:
    """Keeps map and observation together; ``look`` at each new scan, ``refresh`` before asking about clearances."""

    def __init__(self, static: StaticMap, settings: NavigationSettings) -> None:
        self.static = static
        self.observed = ObservedObstacles(static, settings)
        self._settings = settings
        self.window = Geometry(0.0, 0.0, static.geometry.resolution, 0, 0)
        self.distance: Field = np.zeros((0, 0), dtype=np.float32)
        self._cells: Array = np.empty((0, 2))
        self.static_distance = distance_field(static.blocked, static.geometry.resolution)

    def look(self, scan: Scan, chassis: Pose, footprint: Footprint) -> None:
        """Take a scan that was seen with the chassis at that pose."""
        self.observed.integrate(scan, chassis, footprint.edges)

    def refresh(self, pose: Pose) -> None:
        """Distances and cells around the pose, from map and observation as they are now."""
        g = self.static.geometry
        row, column = g.cell(pose[0], pose[1])
        reach = int(WINDOW / g.resolution)
        r0, r1 = _span(row, reach, g.rows)
        c0, c1 = _span(column, reach, g.columns)
        window = (slice(r0, r1), slice(c0, c1))
        blocked = self.observed.blocked(window)
        self.window = Geometry(
            g.x + c0 * g.resolution, g.y + r0 * g.resolution, g.resolution, max(r1 - r0, 0), max(c1 - c0, 0)
        )
        self.distance = distance_field(blocked, g.resolution) if blocked.size else np.zeros((0, 0), dtype=np.float32)
        self._cells = nearby_cells(blocked, g, window)

    def blocked(self) -> Mask:
        """Map and observation, everywhere."""
        return self.observed.blocked()

    def clearance(self, footprint: Footprint, pose: Pose, enough: float = 1.0) -> float:
        """Metres between the body at a pose and the nearest thing, within the refreshed part."""
        w = self.window
        return float(
            clearance(
                self.distance,
                w.x,
                w.y,
                w.resolution,
                footprint.samples,
                footprint.circumscribed,
                pose[0],
                pose[1],
                pose[2],
                enough,
            )
        )

    def sweep_clearance(self, footprint: Footprint, pose: Pose, turn: float) -> float:
        """The least clearance while turning on the spot."""
        w = self.window
        return float(
            sweep_clearance(
                self.distance,
                w.x,
                w.y,
                w.resolution,
                footprint.samples,
                footprint.circumscribed,
                pose[0],
                pose[1],
                pose[2],
                turn,
                0.0,
            )
        )

    def obstacles(self, pose: Pose) -> Array:
        """Rows x, y, vx, vy, margin of everything within reach of a stop: cells by their edge, hits as they are."""
        s = self._settings
        cells = as_obstacles(self._within(self._cells, pose), 0.5 * self.static.geometry.resolution + s.safety_margin)
        hits = as_obstacles(self._within(self.observed.points, pose), s.safety_margin)
        return np.vstack([cells, hits])

    def _within(self, points: Array, pose: Pose) -> Array:
        reach = np.abs(points - pose[:2]).max(axis=1) < self._settings.safety_radius if len(points) else slice(0)
        return points[reach]

    def speed_limit(self, pose: Pose) -> float:
        """m/s where the chassis is."""
        row, column = self.static.geometry.cell(pose[0], pose[1])
        limits = self.static.speed_limit
        inside = 0 <= row < limits.shape[0] and 0 <= column < limits.shape[1]
        return float(limits[row, column]) if inside else float("inf")


def _span(middle: int, reach: int, size: int) -> tuple[int, int]:
    return min(max(middle - reach, 0), size), max(min(middle + reach + 1, size), 0)


def is_usable(scan: Scan, min_valid_fraction: float) -> bool:
    """Whether enough beams returned something: a lidar that sees nothing at all is blind, not free."""
    ranges = scan.ranges
    return bool(ranges.size) and float(np.mean((ranges > 0.0) & np.isfinite(ranges))) >= min_valid_fraction
