"""A map with its overlays, lying on the floor."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from typing import Any

import numpy as np
import rerun as rr
from PIL import Image

from rackhand.schemas.maps import LineType, MapData, Overlays, RegionType, overlay_code
from rackhand.services.viewer import colours
from rackhand.services.viewer.items import Drawing

MAP_Z, OVERLAY_Z = 0.004, 0.02


def map_drawings(robot: str, data: MapData | None) -> Iterable[Drawing]:
    """What replaces the robot's former map."""
    yield Drawing(f"{robot}/map", (_grid(data) if data is not None else rr.Clear(recursive=False),), static=True)
    yield Drawing(f"{robot}/overlays", (_overlays(data.overlays if data is not None else {}),), static=True)


def _grid(data: MapData) -> rr.GridMap:
    with Image.open(BytesIO(data.png)) as image:
        grey = np.asarray(image.convert("L"))
    return rr.GridMap(
        data=grey.tobytes(),
        format=rr.components.ImageFormat(
            width=grey.shape[1], height=grey.shape[0], color_model="L", channel_datatype="U8"
        ),
        cell_size=data.resolution,
        translation=(*data.origin, MAP_Z),
        colormap=rr.components.Colormap.Grayscale,
        opacity=0.5,
    )


def _overlays(overlays: Overlays) -> rr.LineStrips3D:
    """Virtual walls, regions and their names. Points of interest are left out."""
    strips, shades, labels = [], [], []
    for feature in overlays.get("features", ()):
        properties = feature.get("properties") or {}
        for line in _lines(feature.get("geometry") or {}):
            strips.append(np.column_stack([np.array(line, dtype=np.float64)[:, :2], np.full(len(line), OVERLAY_Z)]))
            shades.append(_shade(properties))
            labels.append(str(properties.get("name") or ""))
    return rr.LineStrips3D(
        strips, colors=shades, radii=rr.Radius.ui_points(1.5), labels=labels or None, show_labels=False
    )


def _lines(geometry: dict[str, Any]) -> list[Any]:
    coordinates = geometry.get("coordinates", [])
    match geometry.get("type"):
        case "LineString":
            return [coordinates]
        case "Polygon":
            return list(coordinates)
        case _:
            return []


def _shade(properties: dict[str, Any]) -> tuple[int, int, int, int]:
    line, region = overlay_code(properties.get("lineType")), overlay_code(properties.get("regionType"))
    if line == LineType.VIRTUAL_WALL or region == RegionType.NO_GO:
        return colours.WALL
    return colours.SLOW if region == RegionType.SLOW else colours.AREA
