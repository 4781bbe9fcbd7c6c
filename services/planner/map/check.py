"""Is this a map? Checks of PNG and GeoJSON before anything is kept or driven by."""

from __future__ import annotations

import io
import math
from typing import Any

from PIL import Image, UnidentifiedImageError

from rackhand.schemas.maps import CreateMap, Overlays
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.plain_json import json_error

MAX_PIXELS = 50_000_000
RESOLUTION_RANGE = (0.001, 1.0)  # metres a cell
_GEOMETRIES = {"Point": 0, "LineString": 1, "Polygon": 2}  # how many lists are around a position


def check_map(created: CreateMap) -> None:
    """Raises ``RequestRefused`` (invalid) saying what is wrong, where, and what was expected."""
    low, high = RESOLUTION_RANGE
    if not low <= created.resolution <= high:
        raise _invalid("resolution", f"{created.resolution} m a cell, want {low} … {high}")
    check_png(created.png)
    check_overlays(created.overlays)


def check_png(png: bytes) -> tuple[int, int]:
    """Width and height of an 8-bit grey PNG that can be read to its end."""
    try:
        with Image.open(io.BytesIO(png), formats=["PNG"]) as image:
            width, height = image.size
            if width * height > MAX_PIXELS:
                raise _invalid("png", f"{width} × {height} pixels, want at most {MAX_PIXELS:,} in all")
            if image.mode != "L":
                raise _invalid("png", f"its mode is {image.mode}, want 8-bit grey (L)")
            image.load()
    except UnidentifiedImageError:
        raise _invalid("png", f"not a PNG image ({len(png)} bytes, starts {png[:8].hex() or 'with nothing'})") from None
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise _invalid("png", f"cannot be read to its end: {error}") from None
    return width, height


def check_overlays(overlays: Overlays) -> None:
    """A FeatureCollection of points, lines and polygons in finite map coordinates. Rings may be open."""
    if (trouble := json_error(overlays)) is not None:
        raise _invalid("overlays", trouble)
    if overlays.get("type") != "FeatureCollection":
        raise _invalid("overlays.type", f"{overlays.get('type')!r}, want 'FeatureCollection'")
    features = overlays.get("features")
    if not isinstance(features, list):
        raise _invalid("overlays.features", f"{type(features).__name__}, want a list")
    for index, feature in enumerate(features):
        _check_feature(f"overlays.features[{index}]", feature)


def _check_feature(where: str, feature: Any) -> None:
    if not isinstance(feature, dict) or feature.get("type") != "Feature":
        raise _invalid(where, "want an object of type 'Feature'")
    if not isinstance(feature.get("properties"), dict | None):
        raise _invalid(f"{where}.properties", f"{type(feature['properties']).__name__}, want an object")
    geometry = feature.get("geometry")
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if not isinstance(geometry, dict) or not isinstance(kind, str) or kind not in _GEOMETRIES:
        raise _invalid(f"{where}.geometry", f"type {kind!r}, want one of {', '.join(_GEOMETRIES)}")
    coordinates: Any = geometry.get("coordinates")
    _check_positions(f"{where}.geometry.coordinates", coordinates, _GEOMETRIES[kind])
    if kind == "LineString" and len(coordinates) < 2:
        raise _invalid(f"{where}.geometry.coordinates", f"{len(coordinates)} positions, want at least 2")
    if kind == "Polygon":
        _check_rings(f"{where}.geometry.coordinates", coordinates)


def _check_positions(where: str, value: Any, depth: int) -> None:
    if not isinstance(value, list):
        raise _invalid(where, f"{type(value).__name__}, want a list")
    if depth:
        for index, item in enumerate(value):
            _check_positions(f"{where}[{index}]", item, depth - 1)
    elif len(value) not in (2, 3) or not all(_is_finite(number) for number in value):
        raise _invalid(where, f"{value!r:.60}, want x, y in metres")


def _check_rings(where: str, rings: list[list[list[float]]]) -> None:
    if not rings:
        raise _invalid(where, "no ring, want at least 1")
    for index, ring in enumerate(rings):
        corners = {tuple(position[:2]) for position in ring}
        if len(corners) < 3:
            raise _invalid(f"{where}[{index}]", f"{len(corners)} different corners, want at least 3")


def _is_finite(number: Any) -> bool:
    return isinstance(number, int | float) and not isinstance(number, bool) and math.isfinite(number)


def _invalid(where: str, what: str) -> RequestRefused:
    return RequestRefused(RefusalCode.INVALID, f"{where}: {what}")
