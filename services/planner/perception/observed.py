"""Obstacles that the scan shows and the map does not: evidence in the map's cells, added by hits, removed by rays."""

from __future__ import annotations

import math
import mmap
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.schemas.chassis import Scan
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import distance_to_body
from rackhand.services.planner.geometry.se2 import Pose, compose
from rackhand.services.planner.geometry.se2 import pose as as_pose
from rackhand.services.planner.map.grid import Mask, StaticMap
from rackhand.services.planner.planning.field import near_blocked
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]

HIT, MISS, FULL, OCCUPIED = 3, 2, 6, 3  # one hit occupies; two rays through it clear the firmest cell
SLACK, SLACK_PER_METRE, MOST_SLACK = 0.015, 0.005, 0.025  # m beside a firm cell in which a hit is one of it, by range
BESIDE, RANGE_NOISE, MOST_BESIDE = 0.015, 0.04, 6  # m between hits of one place, m of their ranges, and beams to a side
FRESH, LATELY = 8, 60  # scans since the first hit of a cell, and since it was seen free before that
SCAN_PERIOD = 0.08  # s; ages are counted in scans
TILE = 32  # cells to each side
RAY_STEP = 0.7  # of a cell between the points of a ray that are looked at
WRITTEN_CELLS = 4_000_000
WHOLE = (slice(None), slice(None))

Flags = NDArray[np.bool_]
Counts = NDArray[np.int32]


class Evidence(NamedTuple):
    """What is known of each cell of the map, arrays (rows, columns).

    ``mapped``: near an obstacle of the map, so that hits there are nothing new. ``level``: 0 to ``FULL``. The rest are
    numbers of scans: that touched the cell last, at which it is forgotten, that hit it first, that saw it free last.
    """

    geometry: Geometry
    mapped: Mask
    level: NDArray[np.int8]
    touched: Counts
    expires: Counts
    first_hit: Counts
    seen_free: Counts

    @staticmethod
    def of(static: StaticMap, match_distance: float) -> Evidence:
        shape = static.blocked.shape
        mapped = near_blocked(static.occupied, match_distance / static.geometry.resolution)
        return Evidence(static.geometry, mapped, _zeros(shape, np.int8), *(_zeros(shape, np.int32) for _ in range(4)))


def _zeros(shape: tuple[int, ...], dtype: type[np.generic]) -> NDArray[Any]:
    """Zeros for which a tick does not wait.

    Memory that is touched first in a tick costs the tick its page faults, so that of a map of usual size is written
    here. Of a large map most is never seen, and is never given any memory; its pages are small ones, because for
    ``np.zeros`` the system clears 2 MB at the first touch.
    """
    size = math.prod(shape)
    if size <= WRITTEN_CELLS:
        return np.full(shape, 0, dtype=dtype)
    return np.frombuffer(mmap.mmap(-1, size * np.dtype(dtype).itemsize), dtype=dtype).reshape(shape)


class Beams(NamedTuple):
    """One scan: ranges (n,) in metres, ``sensor`` pose in the map, angle of the first beam and between beams in
    radians, ``max_range`` beyond which hits do not count. ``serial``: number of the scan."""

    ranges: Array
    sensor: Pose
    angle_min: float
    angle_step: float
    max_range: float
    serial: int


class Hits(NamedTuple):
    """Hits of a scan in the map frame (n, 2); whether each is missing on the map (n,), whether it is where nothing was
    seen a moment ago (n,), and whether it is beside what has been in one place for a while (n,)."""

    points: Array
    unmapped: Flags
    fresh: Flags
    steady: Flags


class ObservedObstacles:
    """Evidence grid over the map. A cell is an obstacle at the first hit and free again after one or two scans whose
    rays pass through it; what is never seen again is forgotten after a while, dynamic obstacles sooner."""

    def __init__(self, static: StaticMap, settings: NavigationSettings) -> None:
        self._static = static
        self._settings = settings
        self._evidence = Evidence.of(static, settings.static_match_distance)
        # Tiles with unmapped hits since they were last found empty.
        self._tiles = np.zeros([n // TILE + 1 for n in static.blocked.shape], dtype=np.bool_)
        self._scans = 0
        self._hits = Hits(np.empty((0, 2)), *(np.empty(0, dtype=np.bool_) for _ in range(3)))

    @property
    def points(self) -> Array:
        """Hits of the newest scan in the map frame, (n, 2)."""
        return self._hits.points

    @property
    def unmapped(self) -> Flags:
        """Whether each hit is missing on the map, (n,)."""
        return self._hits.unmapped

    @property
    def fresh(self) -> Flags:
        """Whether each hit is where nothing was seen a moment ago, (n,)."""
        return self._hits.fresh

    @property
    def steady(self) -> Flags:
        """Whether each hit is beside what has been in one place for a while, (n,)."""
        return self._hits.steady

    def integrate(self, scan: Scan, chassis: Pose, body_edges: Array) -> None:
        """Take one scan, seen with the chassis at that map pose. Hits inside the body are its own parts."""
        self._scans += 1
        beams = Beams(
            scan.ranges.astype(np.float64), compose(chassis, as_pose(scan.sensor)), float(scan.angle_min),
            float(scan.angle_step), float(min(scan.range_max, self._settings.obstacle_range)), self._scans,
        )  # fmt: skip
        points, means = hit_points(beams, chassis, body_edges)
        expiry = self._scans + int(self._settings.forget_after / SCAN_PERIOD)
        steady = beside_steady(self._evidence, points, self._scans)
        unmapped, fresh = mark_hits(self._evidence, means, beams.sensor, self._scans, expiry)
        clear_rays(self._evidence, beams)
        self._hits = Hits(points, unmapped, fresh, steady)
        rows, columns = self._cells_of(points[unmapped])
        self._tiles[rows // TILE, columns // TILE] = True

    def _cells_of(self, points: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of those points, (n, 2) in the map frame, that are on the map."""
        g = self._static.geometry
        cells = np.floor((points - (g.x, g.y)) / g.resolution).astype(np.int64)
        inside = ((cells >= 0) & (cells < (g.columns, g.rows))).all(axis=1)
        return cells[inside, 1], cells[inside, 0]

    def cells(self, within: float = math.inf) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of all cells with an observed obstacle that a beam met in the last ``within`` seconds. Costs
        time by what was observed, not by the map."""
        since = self._scans - math.ceil(within / SCAN_PERIOD) if math.isfinite(within) else -1
        rows: list[NDArray[np.int64]] = [np.empty(0, dtype=np.int64)]
        columns = rows.copy()
        for i, j in np.argwhere(self._tiles):
            window = (slice(i * TILE, (i + 1) * TILE), slice(j * TILE, (j + 1) * TILE))
            occupied = self.occupied(window)
            self._tiles[i, j] = occupied.any()
            r, c = np.nonzero(occupied & (self._evidence.touched[window] > since))
            rows.append(r + i * TILE)
            columns.append(c + j * TILE)
        return np.concatenate(rows), np.concatenate(columns)

    def is_seen_free(self, point: Array) -> bool:
        """Whether a ray of the newest scan passed through this place."""
        g = self._static.geometry
        return g.contains(point[0], point[1]) and bool(
            self._evidence.seen_free[g.cell(point[0], point[1])] == self._scans
        )

    def survey(self, cells: NDArray[np.int64], scans: int) -> tuple[Flags, Flags]:
        """Of cells given by flat indices: which hold an obstacle that was seen, and which were seen free, in the last
        ``scans`` scans. What is near an obstacle of the map is that obstacle."""
        e, since = self._evidence, max(self._scans - scans, 0)
        firm = e.level.reshape(-1)[cells] >= OCCUPIED
        occupied = firm & (e.touched.reshape(-1)[cells] > since) & (e.expires.reshape(-1)[cells] > self._scans)
        free = ~firm & (e.seen_free.reshape(-1)[cells] > since)
        return occupied, free

    def unmapped_cells(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Those of the cells that are not near an obstacle of the map."""
        return cells[~self._evidence.mapped.reshape(-1)[cells]]

    def clear(self, cells: NDArray[np.int64]) -> None:
        """Forget the obstacles in these cells."""
        self._evidence.level.reshape(-1)[cells] = 0

    def shorten(self, centre: Array, radius: float) -> None:
        """A dynamic obstacle is there now but not for long: forget its cells soon after they are last seen."""
        g = self._static.geometry
        r0, c0 = g.cell(centre[0] - radius, centre[1] - radius)
        r1, c1 = g.cell(centre[0] + radius, centre[1] + radius)
        window = (slice(max(r0, 0), max(r1 + 1, 0)), slice(max(c0, 0), max(c1 + 1, 0)))
        soon = self._scans + int(self._settings.forget_mover_after / SCAN_PERIOD)
        expires = self._evidence.expires[window]
        np.minimum(expires, soon, out=expires)

    def occupied(self, window: tuple[slice, slice] = WHOLE) -> Mask:
        """Cells of the observed obstacles that are not on the map, in a window of rows and columns."""
        return (self._evidence.level[window] >= OCCUPIED) & (self._evidence.expires[window] > self._scans)


@compiled
def hit_points(beams: Beams, chassis: Pose, body_edges: Array) -> tuple[Array, Array]:
    """Hits within range in the map frame, (n, 2), without those inside the body at pose ``chassis``; and for each the
    mean of the hits of its place, (n, 2)."""
    points = np.empty((beams.ranges.size, 2), dtype=np.float64)
    means = np.empty_like(points)
    n = 0
    for k in range(beams.ranges.size):
        reach = beams.ranges[k]
        if not (reach > 0.0 and reach <= beams.max_range):
            continue
        x, y = _end(beams, k)
        if distance_to_body(body_edges, chassis, x, y) > 0.0:
            points[n, 0], points[n, 1] = x, y
            means[n, 0], means[n, 1] = _mean_beside(beams, k)
            n += 1
    return points[:n].copy(), means[:n].copy()


@compiled
def _end(beams: Beams, k: int) -> tuple[float, float]:
    angle = beams.sensor[2] + beams.angle_min + k * beams.angle_step
    return beams.sensor[0] + beams.ranges[k] * math.cos(angle), beams.sensor[1] + beams.ranges[k] * math.sin(angle)


@compiled
def _mean_beside(beams: Beams, k: int) -> tuple[float, float]:
    """The mean of a hit and those of the beams next to it that are of the same place.

    Near the lidar a cell takes so many hits that the noise of the range puts one of them into the next cell in most
    scans. Where beams are farther apart than ``BESIDE`` a hit remains as it is.
    """
    reach = beams.ranges[k]
    x, y = _end(beams, k)
    n = 1
    most = min(math.floor(BESIDE / (reach * abs(beams.angle_step))), MOST_BESIDE)
    for side in (-1, 1):
        for m in range(1, most + 1):
            other = k + side * m
            if not (0 <= other < beams.ranges.size and abs(beams.ranges[other] - reach) <= RANGE_NOISE):
                break
            there = _end(beams, other)
            x, y, n = x + there[0], y + there[1], n + 1
    return x / n, y / n


@compiled
def beside_steady(evidence: Evidence, points: Array, serial: int) -> Flags:
    """Whether each of the hits (n, 2) is in or beside a cell that was hit first more than ``FRESH`` scans ago and is an
    obstacle since."""
    g = evidence.geometry
    steady = np.zeros(len(points), dtype=np.bool_)
    for k in range(len(points)):
        i = math.floor((points[k, 1] - g.y) / g.resolution)
        j = math.floor((points[k, 0] - g.x) / g.resolution)
        for a in range(max(i - 1, 0), min(i + 2, g.rows)):
            for b in range(max(j - 1, 0), min(j + 2, g.columns)):
                is_there = evidence.level[a, b] >= OCCUPIED and evidence.expires[a, b] > serial
                if is_there and serial - evidence.first_hit[a, b] > FRESH:
                    steady[k] = True
    return steady


@compiled
def mark_hits(evidence: Evidence, points: Array, sensor: Pose, serial: int, expiry: int) -> tuple[Flags, Flags]:
    """Adds the hits (n, 2) of scan ``serial``, seen from ``sensor``, to the evidence, which is forgotten at scan
    ``expiry``; a cell counts once a scan. Returns ``unmapped`` and ``fresh`` of ``Hits``."""
    g = evidence.geometry
    unmapped = np.zeros(len(points), dtype=np.bool_)
    fresh = np.zeros(len(points), dtype=np.bool_)
    for k in range(len(points)):
        i = math.floor((points[k, 1] - g.y) / g.resolution)
        j = math.floor((points[k, 0] - g.x) / g.resolution)
        if not (0 <= i < g.rows and 0 <= j < g.columns):
            continue
        if not evidence.mapped[i, j]:
            unmapped[k] = True
            i, j = _owner(evidence, points[k], sensor, i, j, serial)
            evidence.expires[i, j] = expiry
            if evidence.level[i, j] == 0:
                evidence.first_hit[i, j] = serial
            first, free = evidence.first_hit[i, j], evidence.seen_free[i, j]
            fresh[k] = serial - first <= FRESH and free > 0 and free >= first - LATELY
            if evidence.touched[i, j] != serial:
                evidence.level[i, j] = min(evidence.level[i, j] + HIT, FULL)
        evidence.touched[i, j] = serial
    return unmapped, fresh


@compiled
def _owner(evidence: Evidence, point: Array, sensor: Pose, i: int, j: int, serial: int) -> tuple[int, int]:
    """The cell for which a hit in cell ``i``, ``j`` counts: that one, or a firm one beside it that is nearer to the hit
    than the noise of range and pose.

    Else a surface near the edge of a cell occupies the next one, too, in each scan whose noise is on that side, and a
    gap between two such surfaces is narrower by two cells than it is. Near the chassis the slack is what the braking
    guard keeps from the edge of a cell, and everywhere it is less than the clearance of a plan.
    """
    if evidence.level[i, j] == FULL:
        return i, j
    g = evidence.geometry
    away = math.hypot(point[0] - sensor[0], point[1] - sensor[1])
    nearest = min(SLACK + SLACK_PER_METRE * max(away - 1.0, 0.0), MOST_SLACK)
    x, y = point[0] - g.x - (j + 0.5) * g.resolution, point[1] - g.y - (i + 0.5) * g.resolution
    owner = (i, j)
    for a in range(max(i - 1, 0), min(i + 2, g.rows)):
        for b in range(max(j - 1, 0), min(j + 2, g.columns)):
            if evidence.level[a, b] < FULL or evidence.expires[a, b] <= serial:
                continue
            beside = max(abs(x - (b - j) * g.resolution) - 0.5 * g.resolution, 0.0)
            before = max(abs(y - (a - i) * g.resolution) - 0.5 * g.resolution, 0.0)
            if math.hypot(beside, before) < nearest:
                nearest, owner = math.hypot(beside, before), (a, b)
    return owner


@compiled
def _blur(beams: Beams, k: int, resolution: float) -> float:
    """Metres before a hit that a ray leaves as they are: a cell, for those of the surface that no beam hits this time.

    Where hits are dense each cell of the surface is hit, and only what may be noise is left, so that a cell before the
    surface does not stay occupied.
    """
    reach = beams.ranges[k]
    if reach * abs(beams.angle_step) > BESIDE or k == 0 or k == beams.ranges.size - 1:
        return resolution
    before, after = beams.ranges[k - 1], beams.ranges[k + 1]
    is_dense = abs(before - reach) <= RANGE_NOISE and abs(after - reach) <= RANGE_NOISE
    return SLACK if is_dense else resolution


@compiled
def clear_rays(evidence: Evidence, beams: Beams) -> None:
    """Removes evidence along the rays of a scan, from cells that it did not hit."""
    g, serial = evidence.geometry, beams.serial
    for k in range(beams.ranges.size):
        reach = beams.ranges[k]
        if not reach > 0.0:  # NaN is no measurement
            continue
        length = beams.max_range if math.isinf(reach) else min(reach - _blur(beams, k, g.resolution), beams.max_range)
        angle = beams.sensor[2] + beams.angle_min + k * beams.angle_step
        dx, dy = math.cos(angle), math.sin(angle)
        travelled = 0.0
        while travelled < length:
            i = math.floor((beams.sensor[1] + travelled * dy - g.y) / g.resolution)
            j = math.floor((beams.sensor[0] + travelled * dx - g.x) / g.resolution)
            if i < 0 or j < 0 or i >= g.rows or j >= g.columns:
                break
            if evidence.touched[i, j] != serial:
                evidence.touched[i, j] = serial
                evidence.seen_free[i, j] = serial
                if evidence.level[i, j] > 0:
                    evidence.level[i, j] = max(evidence.level[i, j] - MISS, 0)
            travelled += RAY_STEP * g.resolution
