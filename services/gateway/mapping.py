"""Mapping runs: an occupancy grid from scans taken at known poses (Moravec & Elfes 1985, with log odds)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas import planar
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Scan
from rackhand.services.gateway.ws.files import grey_png

RESOLUTION = 0.05  # m a cell
RANGE = 10.0  # m of a beam that are used
MOST_CELLS = 4_000_000
BLOCK = 100  # cells by which the grid grows
FREE, HIT = -0.4, 0.9  # log odds a cell gets from a beam that passes, or ends in it
LIMIT = 4.0
SPACING = 0.05  # m driven, or rad turned, between scans that are drawn
LONGEST = 0.5  # s between scans that are drawn
OCCUPIED, UNKNOWN, EMPTY = 0, 205, 254  # grey, as map servers write them

State = Literal["running", "finished", "cancelled"]
Cells = NDArray[np.int64]


@dataclass
class Grid:
    """Log odds of occupancy, rows from the bottom; ``low``: column and row of its corner in cells of the map frame."""

    odds: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.float32))
    low: tuple[int, int] = (0, 0)

    def add(self, columns: Cells, rows: Cells, odds: float) -> None:
        """Cells of the map frame; those beyond the largest grid are left out."""
        if not columns.size or not self._cover(columns, rows):
            return
        flat = np.unique((rows - self.low[1]) * self.odds.shape[1] + columns - self.low[0])
        cells = self.odds.reshape(-1)
        cells[flat] = np.clip(cells[flat] + odds, -LIMIT, LIMIT)

    def _cover(self, columns: Cells, rows: Cells) -> bool:
        """Grow to hold these cells; False where the grid would be too large."""
        c0, r0, c1, r1 = int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1
        height, width = self.odds.shape
        if self.odds.size:
            c0, r0 = min(c0, self.low[0]), min(r0, self.low[1])
            c1, r1 = max(c1, self.low[0] + width), max(r1, self.low[1] + height)
            if (c0, r0, c1, r1) == (*self.low, self.low[0] + width, self.low[1] + height):
                return True
        c0, r0 = c0 // BLOCK * BLOCK, r0 // BLOCK * BLOCK
        c1, r1 = -(-c1 // BLOCK) * BLOCK, -(-r1 // BLOCK) * BLOCK
        if (c1 - c0) * (r1 - r0) > MOST_CELLS:
            return False
        grown = np.zeros((r1 - r0, c1 - c0), dtype=np.float32)
        if self.odds.size:
            column, row = self.low[0] - c0, self.low[1] - r0
            grown[row : row + height, column : column + width] = self.odds
        self.odds, self.low = grown, (c0, r0)
        return True


@dataclass
class Mapping:
    """One run: scans in, a picture out. ``start``: the pose, map frame, that is the origin of the new map."""

    id: int
    start_time: int
    start: Pose2
    state: State = "running"
    end_time: int | None = None
    grid: Grid = field(default_factory=Grid)
    trajectory: list[tuple[float, float]] = field(default_factory=list)
    _drawn: tuple[int, Pose2] | None = None

    def take(self, scan: Scan, pose: Pose2) -> None:
        """A scan, and the pose in the map frame at which it was taken."""
        if self.state != "running" or not self._is_news(scan, pose):
            return
        self._drawn = scan.stamp, pose
        x, y, yaw = planar.between((self.start.x, self.start.y, self.start.yaw), (pose.x, pose.y, pose.yaw))
        self.trajectory.append((round(x, 3), round(y, 3)))
        sensor = planar.compose((x, y, yaw), (scan.sensor.x, scan.sensor.y, scan.sensor.yaw))
        ranges = scan.ranges.astype(np.float64)
        known = ~np.isnan(ranges)
        hits = known & (ranges < min(scan.range_max, RANGE))
        beams = np.arange(len(ranges), dtype=np.float64)
        angles: NDArray[np.float64] = sensor[2] + scan.angle_min + scan.angle_step * beams
        reach: NDArray[np.float64] = np.minimum(np.where(known, ranges, 0.0), min(scan.range_max, RANGE))
        passed = _along(sensor, angles[known], (reach - RESOLUTION * hits)[known])
        ends = sensor[0] + reach[hits] * np.cos(angles[hits]), sensor[1] + reach[hits] * np.sin(angles[hits])
        self.grid.add(*_cells(*passed), FREE)
        self.grid.add(*_cells(*ends), HIT - FREE)  # beams that pass beside them are in the same cells

    def finish(self, state: Literal["finished", "cancelled"], now: int) -> None:
        self.state, self.end_time = state, max(now, self.start_time)

    @property
    def origin(self) -> tuple[float, float]:
        """The lower-left corner, metres."""
        return round(self.grid.low[0] * RESOLUTION, 4), round(self.grid.low[1] * RESOLUTION, 4)

    def png(self) -> bytes:
        """8-bit grey, row 0 at the top; one unknown cell before the first scan."""
        odds = self.grid.odds if self.grid.odds.size else np.zeros((1, 1), dtype=np.float32)
        grey = np.full(odds.shape, UNKNOWN, dtype=np.uint8)
        grey[odds < 0.0], grey[odds > 0.0] = EMPTY, OCCUPIED
        return grey_png(np.flipud(grey))

    def _is_news(self, scan: Scan, pose: Pose2) -> bool:
        if self._drawn is None:
            return True
        stamp, last = self._drawn
        moved = math.hypot(pose.x - last.x, pose.y - last.y) + abs(planar.wrap(pose.yaw - last.yaw))
        return moved >= SPACING or not 0 <= scan.stamp - stamp < LONGEST * 1e9


class Mappings:
    """The runs of one robot since the gateway started, one of them running at most."""

    def __init__(self) -> None:
        self.runs: dict[int, Mapping] = {}
        self._last = 0

    @property
    def running(self) -> Mapping | None:
        return next((run for run in self.runs.values() if run.state == "running"), None)

    def begin(self, start: Pose2, now: int) -> Mapping:
        """Raises ``ValueError`` while one runs."""
        if self.running is not None:
            raise ValueError(f"mapping {self.running.id} is running; finish or cancel it first")
        self._last += 1
        run = self.runs[self._last] = Mapping(self._last, now, start)
        return run

    def take(self, scan: Scan, pose: Pose2) -> None:
        if (run := self.running) is not None:
            run.take(scan, pose)


def _along(
    sensor: planar.PlanarPose, angles: NDArray[np.float64], reach: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points on the beams, half a cell apart."""
    steps = np.arange(0.0, max(float(reach.max(initial=0.0)), 0.0), RESOLUTION / 2)
    inside = steps[None, :] < reach[:, None]
    x = sensor[0] + steps[None, :] * np.cos(angles)[:, None]
    y = sensor[1] + steps[None, :] * np.sin(angles)[:, None]
    return x[inside], y[inside]


def _cells(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[Cells, Cells]:
    return np.floor(x / RESOLUTION).astype(np.int64), np.floor(y / RESOLUTION).astype(np.int64)
