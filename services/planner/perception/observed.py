"""What the scan shows that the map does not: evidence in the cells of the map, added by hits, removed by rays."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.schemas.chassis import Scan
from rackhand.services.planner.geometry.se2 import Pose, compose
from rackhand.services.planner.geometry.se2 import pose as as_pose
from rackhand.services.planner.map.grid import Mask, StaticMap
from rackhand.services.planner.planning.field import distance_field
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]

HIT, MISS, FULL, OCCUPIED = 3, 2, 6, 3  # one hit occupies; two rays through it clear the firmest cell
FRESH, LATELY = 8, 60  # scans since something came there, and since it was seen free before that
SCAN_PERIOD = 0.08  # s; ages are counted in scans
TILE = 32  # cells to each side


class ObservedObstacles:
    """Evidence grid over the map. A cell is an obstacle at the first hit and free again after one or two scans whose
    rays pass through it; what is never looked at again is forgotten after a while, movers sooner."""

    def __init__(self, static: StaticMap, settings: NavigationSettings) -> None:
        self._static = static
        self._settings = settings
        near = distance_field(static.occupied, static.geometry.resolution) <= settings.static_match_distance
        self._mapped: Mask = near
        self._evidence = np.zeros(static.blocked.shape, dtype=np.int8)
        self._touched = np.zeros(static.blocked.shape, dtype=np.int32)
        self._expires = np.zeros(static.blocked.shape, dtype=np.int32)
        self._first_hit = np.zeros(static.blocked.shape, dtype=np.int32)
        self._seen_free = np.zeros(static.blocked.shape, dtype=np.int32)
        self._tiles = np.zeros([n // TILE + 1 for n in static.blocked.shape], dtype=np.bool_)  # with hits since emptied
        self._scans = 0
        self.points: Array = np.empty((0, 2))
        self.unmapped: NDArray[np.bool_] = np.empty(0, dtype=np.bool_)
        self.fresh: NDArray[np.bool_] = np.empty(0, dtype=np.bool_)

    def integrate(self, scan: Scan, chassis: Pose, body_edges: Array) -> None:
        """Take one scan, seen with the chassis at that map pose. Hits inside the body are its own parts."""
        self._scans += 1
        g = self._static.geometry
        sensor = compose(chassis, as_pose(scan.sensor))
        self.points, self.unmapped, self.fresh = _integrate(
            self._evidence, self._touched, self._expires, self._first_hit, self._seen_free, self._mapped, g.x, g.y,
            g.resolution, self._scans, self._scans + int(self._settings.forget_after / SCAN_PERIOD),
            scan.ranges.astype(np.float64), sensor, scan.angle_min, scan.angle_step,
            min(scan.range_max, self._settings.obstacle_range), chassis, body_edges,
        )  # fmt: skip

        rows, columns = self._cells_of(self.points[self.unmapped])
        self._tiles[rows // TILE, columns // TILE] = True

    def _cells_of(self, points: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of those points that lie on the map."""
        g = self._static.geometry
        cells = np.floor((points - (g.x, g.y)) / g.resolution).astype(np.int64)
        inside = ((cells >= 0) & (cells < (g.columns, g.rows))).all(axis=1)
        return cells[inside, 1], cells[inside, 0]

    def cells(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of all cells with an observed obstacle. Costs time by what was observed, not by the map."""
        rows: list[NDArray[np.int64]] = [np.empty(0, dtype=np.int64)]
        columns = rows.copy()
        for i, j in np.argwhere(self._tiles):
            window = (slice(i * TILE, (i + 1) * TILE), slice(j * TILE, (j + 1) * TILE))
            r, c = np.nonzero(self.occupied(window))
            self._tiles[i, j] = len(r) > 0
            rows.append(r + i * TILE)
            columns.append(c + j * TILE)
        return np.concatenate(rows), np.concatenate(columns)

    def is_seen_free(self, point: Array) -> bool:
        """Whether a ray of the newest scan passed through this place."""
        g = self._static.geometry
        return g.contains(point[0], point[1]) and bool(self._seen_free[g.cell(point[0], point[1])] == self._scans)

    def shorten(self, centre: Array, radius: float) -> None:
        """What moves is there now but not for long: forget it soon when it gets out of sight."""
        g = self._static.geometry
        r0, c0 = g.cell(centre[0] - radius, centre[1] - radius)
        r1, c1 = g.cell(centre[0] + radius, centre[1] + radius)
        window = (slice(max(r0, 0), max(r1 + 1, 0)), slice(max(c0, 0), max(c1 + 1, 0)))
        soon = self._scans + int(self._settings.forget_mover_after / SCAN_PERIOD)
        np.minimum(self._expires[window], soon, out=self._expires[window])

    def blocked(self, window: tuple[slice, slice] = (slice(None), slice(None))) -> Mask:
        """Map and observation together, in a window of rows and columns."""
        return self._static.blocked[window] | self.occupied(window)

    def occupied(self, window: tuple[slice, slice] = (slice(None), slice(None))) -> Mask:
        """What is observed and not on the map."""
        return (self._evidence[window] >= OCCUPIED) & (self._expires[window] > self._scans)


@compiled
def _integrate(
    evidence: NDArray[np.int8],
    touched: NDArray[np.int32],
    expires: NDArray[np.int32],
    first_hit: NDArray[np.int32],
    seen_free: NDArray[np.int32],
    mapped: Mask,
    x0: float,
    y0: float,
    resolution: float,
    serial: int,
    expiry: int,
    ranges: Array,
    sensor: Pose,
    angle_min: float,
    angle_step: float,
    max_range: float,
    chassis: Pose,
    body_edges: Array,
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Marks hits first, then clears along rays what this scan did not hit. Returns the hits within range in the map
    frame, whether each is missing on the map, and whether it lies where there was seen to be nothing a moment ago."""
    rows, columns = evidence.shape
    points = np.empty((ranges.size, 2), dtype=np.float64)
    unmapped = np.zeros(ranges.size, dtype=np.bool_)
    fresh = np.zeros(ranges.size, dtype=np.bool_)
    n = 0
    c, s = math.cos(chassis[2]), math.sin(chassis[2])
    for k in range(ranges.size):
        reach = ranges[k]
        if not (reach > 0.0 and reach <= max_range):
            continue
        angle = sensor[2] + angle_min + k * angle_step
        x, y = sensor[0] + reach * math.cos(angle), sensor[1] + reach * math.sin(angle)
        bx = c * (x - chassis[0]) + s * (y - chassis[1])
        by = -s * (x - chassis[0]) + c * (y - chassis[1])
        outside = False
        for e in range(body_edges.shape[0]):
            if body_edges[e, 0] * bx + body_edges[e, 1] * by > body_edges[e, 2]:
                outside = True
                break
        if not outside:
            continue
        points[n, 0], points[n, 1] = x, y
        i, j = math.floor((y - y0) / resolution), math.floor((x - x0) / resolution)
        if 0 <= i < rows and 0 <= j < columns:
            if not mapped[i, j]:
                unmapped[n] = True
                expires[i, j] = expiry
                if evidence[i, j] == 0:
                    first_hit[i, j] = serial
                fresh[n] = serial - first_hit[i, j] <= FRESH and 0 < seen_free[i, j] >= first_hit[i, j] - LATELY
                if touched[i, j] != serial:
                    evidence[i, j] = min(evidence[i, j] + HIT, FULL)
            touched[i, j] = serial
        n += 1
    for k in range(ranges.size):
        reach = ranges[k]
        if reach <= 0.0:
            continue
        length = max_range if not math.isfinite(reach) else min(reach - resolution, max_range)
        angle = sensor[2] + angle_min + k * angle_step
        dx, dy = math.cos(angle), math.sin(angle)
        travelled = 0.0
        while travelled < length:
            i = math.floor((sensor[1] + travelled * dy - y0) / resolution)
            j = math.floor((sensor[0] + travelled * dx - x0) / resolution)
            if i < 0 or j < 0 or i >= rows or j >= columns:
                break
            if touched[i, j] != serial:
                touched[i, j] = serial
                seen_free[i, j] = serial
                if evidence[i, j] > 0:
                    evidence[i, j] = max(evidence[i, j] - MISS, 0)
            travelled += 0.7 * resolution
    return points[:n].copy(), unmapped[:n].copy(), fresh[:n].copy()
