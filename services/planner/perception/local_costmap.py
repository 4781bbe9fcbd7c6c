"""What is around the chassis now: the map, what is observed on it, and a distance field of the near part."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.chassis import Scan
from rackhand.schemas.maps import PointType
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.control.braking_guard import as_obstacles, nearby_cells
from rackhand.services.planner.geometry.cells import Geometry, cells_in
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.polygon import inside_convex
from rackhand.services.planner.geometry.se2 import Pose, compose, transformed
from rackhand.services.planner.geometry.se2 import pose as as_pose
from rackhand.services.planner.load import Load
from rackhand.services.planner.map.grid import Mask, StaticMap
from rackhand.services.planner.perception.dynamic_obstacles import DynamicObstacleTracker
from rackhand.services.planner.perception.observed import ObservedObstacles
from rackhand.services.planner.perception.rack_points import RackPoints
from rackhand.services.planner.perception.racks import KnownRack, RackTracker, RackView
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.tiles import TiledClearance
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]
WINDOW = 5.5  # m to each side
MOVER_SHADOW = 0.25  # m around a moving obstacle in which its hits may lie


class LocalCostmap:
    """Keeps map and observation together; ``look`` at each new scan, ``refresh`` before asking about clearances.

    ``mapped``: clearances on the map alone. ``near``: on map and observation, around the last ``refresh``.
    """

    near: DistanceGrid

    def __init__(self, static: StaticMap, settings: NavigationSettings) -> None:
        self.static = static
        self.observed = ObservedObstacles(static, settings)
        self.movers = DynamicObstacleTracker()
        self.racks = RackTracker(static.geometry, settings)
        self.rack_points, self._rack_places = RackPoints(static, settings), _rack_places(static)
        self._velocities: Array = np.empty((0, 2))
        self._stamp = 0
        self.settings = settings
        self._cells: Array = np.empty((0, 2))
        self._standing: Mask = static.blocked
        self._corner = (0, 0)
        self._outlines: list[KnownRack] = []
        self._masks: tuple[Array, ...] = ()
        self._unplanned: tuple[Array, ...] = ()
        self.mapped = TiledClearance(static.blocked, static.geometry)
        g = static.geometry
        self.refresh(np.array([*g.centre(g.rows // 2, g.columns // 2), 0.0]))

    def set_overlays(self, static: StaticMap, pose: Pose | None) -> None:
        """Go on with the same cells and other overlays; ``pose``: of the chassis, where it is known."""
        self.static = static
        self.rack_points, self._rack_places = RackPoints(static, self.settings), _rack_places(static)
        self.mapped = TiledClearance(static.blocked, static.geometry)
        g = static.geometry
        self.refresh(np.array([*g.centre(g.rows // 2, g.columns // 2), 0.0]) if pose is None else pose)

    def look(
        self,
        scan: Scan,
        chassis: Pose,
        footprint: Footprint,
        load: Load | None = None,
        specs: tuple[RackSpec, ...] | None = None,
    ) -> None:
        """Take a scan that was seen with the chassis at that pose. ``specs``: the kinds of racks, if not those of the
        settings."""
        self._stamp = scan.stamp
        self.observed.integrate(scan, chassis, footprint.edges)
        sensor = compose(chassis, as_pose(scan.sensor))
        self._velocities = self.movers.update(self.observed, sensor[:2], scan.stamp)
        outline = transformed(chassis, footprint.polygon)
        kinds = self.settings.rack_specs if specs is None else specs
        view = RackView(self.observed, sensor, chassis, outline, load or Load(), kinds, scan.stamp, self._rack_places)
        self.racks.look(view)
        self.rack_points.look(view, self.racks)
        for mover in self.movers.moving:
            self.observed.shorten(mover.position, mover.radius + 0.3)

    def refresh(self, pose: Pose) -> None:
        """Distances and cells around the pose, from map and observation as they are now."""
        g = self.static.geometry
        row, column = g.cell(pose[0], pose[1])
        reach = int(WINDOW / g.resolution)
        r0, r1 = _span(row, reach, g.rows)
        c0, c1 = _span(column, reach, g.columns)
        window = (slice(r0, r1), slice(c0, c1))
        self._standing, self._corner, self._outlines = self._stands_in(window), (r0, c0), self.racks.blocking
        x, y = g.x + c0 * g.resolution, g.y + r0 * g.resolution
        self.near = DistanceGrid.of(self._with_outlines(), Geometry(x, y, g.resolution, *self._standing.shape))
        self._cells = nearby_cells(self._standing, g, window)

    def clear(self, polygon: Array) -> None:
        """Forget what was observed inside a convex polygon, (n, 2) metres in the map frame."""
        self.observed.clear(cells_in(self.static.geometry, polygon))

    def mask(self, polygon: Array) -> LocalCostmap:
        """This costmap without the obstacles inside a convex polygon, (n, 2) metres in the map frame, and without the
        outline of a rack whose middle is inside."""
        masked = self.planning_through(polygon)
        masked._outlines = _outside(polygon, self._outlines)
        free = cells_in(self.near.geometry, polygon)
        masked._standing = self._standing.copy()
        masked._standing.reshape(-1)[free] = False
        blocked = masked._with_outlines()
        blocked.reshape(-1)[free] = False
        masked.near = DistanceGrid.of(blocked, self.near.geometry)
        masked._masks = (*self._masks, polygon)
        masked._cells = self._cells[~inside_convex(polygon, self._cells)]
        return masked

    def planning_through(self, polygon: Array) -> LocalCostmap:
        """This costmap whose plans leave out observed obstacles inside a convex polygon, (n, 2) metres in the map
        frame, and a rack whose middle is inside: a path then leads up to what is in there, and driving stops before
        it."""
        opened = copy.copy(self)
        opened._unplanned = (*self._unplanned, polygon)
        return opened

    def observed_cells(self, within: float = math.inf) -> NDArray[np.int64]:
        """Flat indices of the cells of the whole map that hold an observed obstacle; what moves will be elsewhere.

        ``within``: seconds; obstacles that were not seen since are left out.
        """
        g = self.static.geometry
        rows, columns = self.observed.cells(within)
        kept = np.ones(len(rows), dtype=np.bool_)
        for mover in self.movers.moving:
            row, column = g.cell(mover.position[0], mover.position[1])
            reach = math.ceil((mover.radius + MOVER_SHADOW) / g.resolution)
            kept &= (np.abs(rows - row) > reach) | (np.abs(columns - column) > reach)
        outlines = [rack for rack in self.racks.blocking if self._stamp - rack.stamp <= within * NANOSECONDS]
        for polygon in self._unplanned:
            outlines = _outside(polygon, outlines)
        flat: NDArray[np.int64] = np.concatenate(
            [rows[kept] * g.columns + columns[kept], *(rack.cells for rack in outlines)]
        )
        for polygon in self._unplanned:
            flat = np.setdiff1d(flat, cells_in(g, polygon))
        return flat

    def blocked(self) -> Mask:
        """Map and observed obstacles, everywhere."""
        mask = self.static.blocked.copy()
        mask.reshape(-1)[self.observed_cells()] = True
        return mask

    def _with_outlines(self) -> Mask:
        """What stands in the window, and the whole of each rack."""
        blocked, g = self._standing.copy(), self.static.geometry
        r0, c0 = self._corner
        for rack in self._outlines:
            rows, columns = rack.cells // g.columns - r0, rack.cells % g.columns - c0
            inside = (rows >= 0) & (rows < blocked.shape[0]) & (columns >= 0) & (columns < blocked.shape[1])
            blocked[rows[inside], columns[inside]] = True
        return blocked

    def _stands_in(self, window: tuple[slice, slice]) -> Mask:
        g = self.static.geometry
        observed = self.observed.occupied(window)
        for mover in self.movers.moving:
            row, column = g.cell(mover.position[0], mover.position[1])
            reach = math.ceil((mover.radius + MOVER_SHADOW) / g.resolution)
            r0, c0 = window[0].start, window[1].start
            rows = slice(max(row - reach - r0, 0), max(row + reach + 1 - r0, 0))
            observed[rows, max(column - reach - c0, 0) : max(column + reach + 1 - c0, 0)] = False
        return observed | self.static.blocked[window]

    def obstacles(self, pose: Pose, touchable: Sequence[Array] = ()) -> Array:
        """Rows x, y, vx, vy, margin of everything within reach of a stop: cells by their edge, hits as they are.

        Racks whose middle is inside one of the convex polygons of ``touchable`` are no more than their hits.
        """
        s, outlines = self.settings, self._outlines
        for polygon in touchable:
            outlines = _outside(polygon, outlines)
        points = np.vstack([self._cells, *(rack.rim for rack in outlines)])
        cells = as_obstacles(self._within(points, pose), 0.5 * self.static.geometry.resolution + s.cell_margin)
        hits = as_obstacles(self.observed.points, s.hit_margin)
        hits[:, 2:4] = self._velocities
        hits[np.abs(self._velocities).any(axis=1), 4] = s.mover_margin
        rows = np.vstack([cells, self._within(hits, pose)])
        for polygon in self._masks:
            rows = rows[~inside_convex(polygon, rows[:, :2])]
        return rows

    def _within(self, points: Array, pose: Pose) -> Array:
        near: Array = points[(np.abs(points[:, :2] - pose[:2]) < self.settings.safety_radius).all(axis=1)]
        return near

    def speed_limit(self, pose: Pose) -> float:
        """m/s where the chassis is."""
        row, column = self.static.geometry.cell(pose[0], pose[1])
        limits = self.static.speed_limit
        inside = 0 <= row < limits.shape[0] and 0 <= column < limits.shape[1]
        return float(limits[row, column]) if inside else float("inf")


def _outside(polygon: Array, racks: list[KnownRack]) -> list[KnownRack]:
    """Those whose middle is not inside a convex polygon."""
    return [rack for rack in racks if not inside_convex(polygon, rack.pose[None, :2])[0]]


def _span(middle: int, reach: int, size: int) -> tuple[int, int]:
    """The window about ``middle`` within ``size``; one cell at the edge for a middle beyond it."""
    return min(max(middle - reach, 0), size - 1), max(min(middle + reach + 1, size), 1)


def is_usable(scan: Scan, min_valid_fraction: float) -> bool:
    """Whether enough beams were measured. A beam without a return (inf) is a measurement: it is free."""
    ranges = scan.ranges
    return bool(ranges.size) and float(np.mean(ranges > 0.0)) >= min_valid_fraction  # False for NaN


def _rack_places(static: StaticMap) -> tuple[Pose, ...]:
    return tuple(np.array([p.x, p.y, p.yaw or 0.0]) for p in static.overlays.points_of(PointType.RACK))
