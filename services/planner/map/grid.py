"""From a stored map to cells: which are occupied, which are traversable, and the speed limit in each."""

from __future__ import annotations

import contextlib
import io
import itertools
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import LineType, MapData, RegionType
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.map.check import MAX_PIXELS
from rackhand.services.planner.map.overlays import MapOverlays, OverlayError, Zone, inside, parse_overlays

# Grey values as map servers write them: free 254, unknown 205, occupied 0. The same limits as ``reading.STORED`` has.
OCCUPIED_BELOW = 90
FREE_ABOVE = 205
BYTES_A_CELL = 12  # picture, masks and what is remembered of a cell that was seen
LEAST_FREE = 2**28  # bytes that loading a map leaves free

Mask = NDArray[np.bool_]
Points = NDArray[np.float64]


@dataclass(frozen=True)
class StaticMap:
    """The map in cells, arrays (rows, columns), and its overlays as features.

    ``occupied``: what a lidar can see. ``blocked``: all non-traversable cells, virtual walls and no-go zones too.
    ``speed_limit``: m/s in each cell, infinite outside slow zones.
    """

    geometry: Geometry
    occupied: Mask
    blocked: Mask
    speed_limit: NDArray[np.float32]
    overlays: MapOverlays


def load_map(data: MapData, slow_velocity: float) -> StaticMap:
    """Raises ``MoveFailed(GET_MAP_FAILED)`` naming what in the map cannot be used."""
    overlays = _overlays(data)
    try:
        return _cells(data, overlays, slow_velocity)
    except MemoryError:
        raise _unusable(data, f"too large for this machine ({max_cells():,} cells at most just now)") from None


def max_cells() -> int:
    """How many cells a map may have on this machine now, by its free memory and the limit of the API."""
    free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    with contextlib.suppress(OSError, ValueError, StopIteration):  # with what the system would give up of its caches
        lines = Path("/proc/meminfo").read_text().splitlines()
        free = next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    return min(MAX_PIXELS, max(free - LEAST_FREE, 0) // BYTES_A_CELL)


def _cells(data: MapData, overlays: MapOverlays, slow_velocity: float) -> StaticMap:
    grey = _decode(data)
    x, y = data.origin
    geometry = Geometry(float(x), float(y), float(data.resolution), *grey.shape)
    occupied = grey < OCCUPIED_BELOW
    blocked = grey <= FREE_ABOVE
    for wall in overlays.lines_of(LineType.VIRTUAL_WALL):
        _draw_line(blocked, geometry, wall.points)
    for zone in overlays.zones_of(RegionType.NO_GO):
        window, within = _inside(geometry, zone)
        blocked[window] |= within
        for ring in zone.rings:
            _draw_line(blocked, geometry, ring)
    return StaticMap(geometry, occupied, blocked, _speed_limits(geometry, overlays, slow_velocity), overlays)


def _speed_limits(geometry: Geometry, overlays: MapOverlays, slow_velocity: float) -> NDArray[np.float32]:
    """Read-only and of no size in memory where there is no slow zone."""
    shape = geometry.rows, geometry.columns
    zones = overlays.zones_of(RegionType.SLOW)
    if not zones:
        return np.broadcast_to(np.float32(np.inf), shape)
    limits = np.full(shape, np.inf, dtype=np.float32)
    for zone in zones:
        window, within = _inside(geometry, zone)
        limits[window][within] = slow_velocity
    return limits


def _overlays(data: MapData) -> MapOverlays:
    try:
        return parse_overlays(data.overlays)
    except OverlayError as error:
        raise _unusable(data, str(error)) from None


def _decode(data: MapData) -> NDArray[np.uint8]:
    """Grey values with row 0 at the bottom, as the map frame has it."""
    try:
        with Image.open(io.BytesIO(data.png), formats=["PNG"]) as image:
            if image.width * image.height > (most := max_cells()):
                raise ValueError(f"{image.width} x {image.height} cells, at most {most:,} fit this machine just now")
            grey = np.asarray(image.convert("L"))
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise _unusable(data, f"its PNG ({len(data.png)} bytes) cannot be read: {error}") from None
    return np.ascontiguousarray(grey[::-1])


def _unusable(data: MapData, why: str) -> MoveFailed:
    return MoveFailed(MoveFailReason.GET_MAP_FAILED, f"map {data.map_name!r} ({data.uid}): {why}")


def _draw_line(mask: Mask, geometry: Geometry, points: Points) -> None:
    for start, end in itertools.pairwise(points):
        clipped = clip(geometry, start, end)
        if clipped is None:
            continue
        first, last = clipped
        steps = int(np.ceil(np.hypot(*(last - first)) / geometry.resolution * 4)) + 1
        along = first + np.linspace(0.0, 1.0, steps)[:, None] * (last - first)
        cells = np.floor((along - (geometry.x, geometry.y)) / geometry.resolution).astype(int)
        keep = (cells >= 0).all(axis=1) & (cells[:, 0] < geometry.columns) & (cells[:, 1] < geometry.rows)
        mask[cells[keep, 1], cells[keep, 0]] = True


def clip(geometry: Geometry, start: Points, end: Points) -> tuple[Points, Points] | None:
    """The part of a line, from (2,) to (2,) in metres, that lies on the map or a cell beside it; None for none.

    Liang & Barsky 1984. A quarter of each number is computed with, so that no finite one overflows.
    """
    g = geometry
    low = np.array([g.x - g.resolution, g.y - g.resolution])
    high = np.array([g.x + (g.columns + 1) * g.resolution, g.y + (g.rows + 1) * g.resolution])
    enter, leave = (0.0, start), (1.0, end)
    for axis in range(2):
        way = 0.25 * end[axis] - 0.25 * start[axis]
        if way == 0.0:
            if not low[axis] <= start[axis] <= high[axis]:
                return None
            continue
        crossings = []
        for bound in (low[axis], high[axis]):
            share = float((0.25 * bound - 0.25 * start[axis]) / way)
            point = start * (1.0 - share) + end * share if 0.0 < share < 1.0 else start
            crossings.append((share, np.where(np.arange(2) == axis, bound, point)))
        crossings.sort(key=lambda crossing: crossing[0])
        enter, leave = (
            max(enter, crossings[0], key=lambda crossing: crossing[0]),
            min(leave, crossings[1], key=lambda crossing: crossing[0]),
        )
    if enter[0] > leave[0]:
        return None
    return np.clip(enter[1], low, high), np.clip(leave[1], low, high)


def _inside(geometry: Geometry, zone: Zone) -> tuple[tuple[slice, slice], Mask]:
    """The window of rows and columns about a zone, and which of its cells have their centre inside."""
    rows, columns = geometry.window(*zone.bounds)
    x = geometry.x + (np.arange(columns.start, columns.stop) + 0.5) * geometry.resolution
    y = geometry.y + (np.arange(rows.start, rows.stop) + 0.5) * geometry.resolution
    return (rows, columns), inside(zone.rings, x, y)
