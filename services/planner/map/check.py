"""Checks of a map's PNG and GeoJSON before it is stored or used."""

from __future__ import annotations

import io

from PIL import Image, UnidentifiedImageError

from rackhand.schemas.maps import CreateMap, Overlays
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.map.overlays import OverlayError, parse_overlays
from rackhand.services.planner.plain_json import json_error

MAX_PIXELS = 110_000_000  # 500 x 500 m at 5 cm, and some
Image.MAX_IMAGE_PIXELS = None  # Pillow warns of large ones; here they are refused before they are decoded
RESOLUTION_RANGE = (0.001, 1.0)  # metres a cell


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
        raise _invalid("png", f"truncated or damaged: {error}") from None
    return width, height


def check_overlays(overlays: Overlays) -> None:
    """A FeatureCollection of points, lines and polygons in finite map coordinates. Rings may be open."""
    if (trouble := json_error(overlays)) is not None:
        raise _invalid("overlays", trouble)
    try:
        parse_overlays(overlays)
    except OverlayError as error:
        raise _invalid(error.where, error.what) from None


def _invalid(where: str, what: str) -> RequestRefused:
    return RequestRefused(RefusalCode.INVALID, f"{where}: {what}")
