"""From a stored map to cells: where there is ground, what is built there, where to go slowly."""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import MapData
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.cells import Geometry as Geometry

# Grey values as map servers write them: free 254, unknown 205, occupied 0.
OCCUPIED_BELOW = 90
FREE_ABOVE = 205
MAX_CELLS = 64_000_000

VIRTUAL_WALL = 2  # lineType
NO_GO, SLOW = 1, 2  # regionType

Mask = NDArray[np.bool_]
Points = NDArray[np.float64]


@dataclass(frozen=True)
class StaticMap:
    """``occupied``: what a lidar can see. ``blocked``: all that is not ground, virtual walls and no-go regions too.

    ``speed_limit``: m/s in each cell, infinite outside slow regions.
    """

    geometry: Geometry
    occupied: Mask
    blocked: Mask
    speed_limit: NDArray[np.float32]


def load_map(data: MapData, slow_velocity: float) -> StaticMap:
    """Raises ``MoveFailed(GET_MAP_FAILED)`` naming what in the map cannot be used."""
    grey = _decode(data)
    geometry = Geometry(*data.origin, data.resolution, *grey.shape)
    occupied = grey < OCCUPIED_BELOW
    blocked = grey <= FREE_ABOVE
    speed_limit = np.full(grey.shape, np.inf, dtype=np.float32)
    for kind, code, rings in _features(data):
        if kind == "LineString" and code == VIRTUAL_WALL:
            _draw_line(blocked, geometry, rings[0])
        elif kind == "Polygon" and code == NO_GO:
            blocked |= _inside(geometry, rings)
            for ring in rings:
                _draw_line(blocked, geometry, ring)
        elif kind == "Polygon" and code == SLOW:
            speed_limit[_inside(geometry, rings)] = slow_velocity
    return StaticMap(geometry, occupied, blocked, speed_limit)


def _decode(data: MapData) -> NDArray[np.uint8]:
    """Grey values with row 0 at the bottom, as the map frame has it."""
    try:
        with Image.open(io.BytesIO(data.png), formats=["PNG"]) as image:
            if image.width * image.height > MAX_CELLS:
                raise ValueError(f"{image.width} x {image.height} cells, at most {MAX_CELLS} are taken")
            grey = np.asarray(image.convert("L"))
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise _unusable(data, f"its PNG ({len(data.png)} bytes) cannot be read: {error}") from None
    return np.ascontiguousarray(grey[::-1])


def _unusable(data: MapData, why: str) -> MoveFailed:
    return MoveFailed(MoveFailReason.GET_MAP_FAILED, f"map {data.map_name!r} ({data.uid}): {why}")


def _features(data: MapData) -> Iterator[tuple[str, int, list[Points]]]:
    """The overlays' lines and polygons that concern driving: geometry type, type code, closed rings or the line."""
    features = data.overlays.get("features", [])
    if not isinstance(features, list):
        raise _unusable(data, f"its overlays' features are {type(features).__name__}, want a list")
    for index, feature in enumerate(features):
        try:
            kind = feature["geometry"]["type"]
            code = _type_code(kind, feature.get("properties") or {})
            if (kind, code) in {("LineString", VIRTUAL_WALL), ("Polygon", NO_GO), ("Polygon", SLOW)}:
                yield kind, code, _rings(kind, feature["geometry"]["coordinates"])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise _unusable(data, f"overlay feature {index}: {type(error).__name__}: {error}") from None


def _type_code(kind: str, properties: dict[str, Any]) -> int:
    """Codes come as numbers or strings; 0 for none."""
    name = {"LineString": "lineType", "Polygon": "regionType"}.get(kind)
    code = properties.get(name) if name else None
    return 0 if code is None else int(code)


def _rings(kind: str, coordinates: Any) -> list[Points]:
    lines = [coordinates] if kind == "LineString" else coordinates
    least = 2 if kind == "LineString" else 3
    rings = []
    for line in lines:
        points = np.asarray([point[:2] for point in line], dtype=np.float64)
        if points.ndim != 2 or len(points) < least or not np.isfinite(points).all():
            raise ValueError(f"{kind} of shape {points.shape}, want at least {least} finite points")
        if kind == "Polygon" and not np.array_equal(points[0], points[-1]):
            points = np.vstack([points, points[:1]])
        rings.append(points)
    if not rings:
        raise ValueError(f"{kind} without points")
    return rings


def _draw_line(mask: Mask, geometry: Geometry, points: Points) -> None:
    for start, end in itertools.pairwise(points):
        steps = int(np.ceil(np.hypot(*(end - start)) / geometry.resolution * 4)) + 1
        along = start + np.linspace(0.0, 1.0, steps)[:, None] * (end - start)
        cells = np.floor((along - (geometry.x, geometry.y)) / geometry.resolution).astype(int)
        keep = (cells >= 0).all(axis=1) & (cells[:, 0] < geometry.columns) & (cells[:, 1] < geometry.rows)
        mask[cells[keep, 1], cells[keep, 0]] = True


def _inside(geometry: Geometry, rings: list[Points]) -> Mask:
    """Cells whose centre lies inside by the even-odd rule, so inner rings are holes."""
    x = geometry.x + (np.arange(geometry.columns) + 0.5) * geometry.resolution
    y = geometry.y + (np.arange(geometry.rows) + 0.5) * geometry.resolution
    inside = np.zeros((geometry.rows, geometry.columns), dtype=np.bool_)
    for ring in rings:
        for (x0, y0), (x1, y1) in itertools.pairwise(ring):
            if y0 == y1:
                continue
            crosses = (y0 > y) != (y1 > y)
            inside[crosses] ^= x[None, :] < (x0 + (y[crosses, None] - y0) * (x1 - x0) / (y1 - y0))
    return inside
