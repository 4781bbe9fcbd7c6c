"""From a stored map to cells: which are occupied, which are traversable, and the speed limit in each."""

from __future__ import annotations

import io
import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import LineType, MapData, RegionType
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.map.overlays import MapOverlays, OverlayError, Zone, inside, parse_overlays

# Grey values as map servers write them: free 254, unknown 205, occupied 0.
OCCUPIED_BELOW = 90
FREE_ABOVE = 205
MAX_CELLS = 64_000_000

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
    grey = _decode(data)
    overlays = _overlays(data)
    x, y = data.origin
    geometry = Geometry(float(x), float(y), float(data.resolution), *grey.shape)
    occupied = grey < OCCUPIED_BELOW
    blocked = grey <= FREE_ABOVE
    speed_limit = np.full(grey.shape, np.inf, dtype=np.float32)
    for wall in overlays.lines_of(LineType.VIRTUAL_WALL):
        _draw_line(blocked, geometry, wall.points)
    for zone in overlays.zones_of(RegionType.NO_GO):
        blocked |= _inside(geometry, zone)
        for ring in zone.rings:
            _draw_line(blocked, geometry, ring)
    for zone in overlays.zones_of(RegionType.SLOW):
        speed_limit[_inside(geometry, zone)] = slow_velocity
    return StaticMap(geometry, occupied, blocked, speed_limit, overlays)


def _overlays(data: MapData) -> MapOverlays:
    try:
        return parse_overlays(data.overlays)
    except OverlayError as error:
        raise _unusable(data, str(error)) from None


def _decode(data: MapData) -> NDArray[np.uint8]:
    """Grey values with row 0 at the bottom, as the map frame has it."""
    try:
        with Image.open(io.BytesIO(data.png), formats=["PNG"]) as image:
            if image.width * image.height > MAX_CELLS:
                raise ValueError(f"{image.width} x {image.height} cells, at most {MAX_CELLS} are supported")
            grey = np.asarray(image.convert("L"))
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise _unusable(data, f"its PNG ({len(data.png)} bytes) cannot be read: {error}") from None
    return np.ascontiguousarray(grey[::-1])


def _unusable(data: MapData, why: str) -> MoveFailed:
    return MoveFailed(MoveFailReason.GET_MAP_FAILED, f"map {data.map_name!r} ({data.uid}): {why}")


def _draw_line(mask: Mask, geometry: Geometry, points: Points) -> None:
    for start, end in itertools.pairwise(points):
        steps = int(np.ceil(np.hypot(*(end - start)) / geometry.resolution * 4)) + 1
        along = start + np.linspace(0.0, 1.0, steps)[:, None] * (end - start)
        cells = np.floor((along - (geometry.x, geometry.y)) / geometry.resolution).astype(int)
        keep = (cells >= 0).all(axis=1) & (cells[:, 0] < geometry.columns) & (cells[:, 1] < geometry.rows)
        mask[cells[keep, 1], cells[keep, 0]] = True


def _inside(geometry: Geometry, zone: Zone) -> Mask:
    """Cells whose centre lies inside."""
    x = geometry.x + (np.arange(geometry.columns) + 0.5) * geometry.resolution
    y = geometry.y + (np.arange(geometry.rows) + 0.5) * geometry.resolution
    return inside(zone.rings, x, y)
