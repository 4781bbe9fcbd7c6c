"""The overlays of a map as typed features, read from GeoJSON: points of interest, lines, zones.

Type codes are numbers or strings. Features without a type code, or with one that is not known, are left out; their
geometry is checked all the same. ``yaw`` is degrees in GeoJSON and radians here.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas import maps
from rackhand.schemas.maps import LineType, PointType, RegionType, overlay_code

Points = NDArray[np.float64]
Properties = Mapping[str, Any]
# Of each geometry: how many lists are around a position, and under which name its features have their type code.
_GEOMETRIES = {"Point": (0, "type"), "LineString": (1, "lineType"), "Polygon": (2, "regionType")}


class OverlayError(ValueError):
    """Overlays that cannot be used: ``where`` (the path of the value), what is there, and what was expected."""

    def __init__(self, where: str, what: str) -> None:
        super().__init__(f"{where}: {what}")
        self.where = where
        self.what = what


@dataclass(frozen=True)
class Feature:
    """What all features have. ``properties`` are those of GeoJSON, all of them."""

    id: str
    name: str
    properties: Properties


@dataclass(frozen=True)
class PointOfInterest(Feature):
    """A place in the map frame, metres; ``yaw`` in radians, None where it has none."""

    type: PointType
    x: float
    y: float
    yaw: float | None

    @property
    def dock_yaw(self) -> float | None:
        """Heading of a chassis under a rack here: ``yaw``, or the opposite where ``dockViaDirection`` is ``back``, as
        then the chassis comes from the other side. No document explains that property; ``front``, the only value seen
        on real maps, and any other one mean ``yaw``."""
        if self.yaw is None or self.properties.get("dockViaDirection") != "back":
            return self.yaw
        return math.remainder(self.yaw + math.pi, math.tau)

    @property
    def docking_point_id(self) -> str | None:
        """Of a charger the id of its docking point, of a docking point that of its charger."""
        value = self.properties.get("dockingPointId")
        return None if value in (None, "") else str(value)


@dataclass(frozen=True)
class Line(Feature):
    """A polyline (n, 2) in metres, n at least 2."""

    type: LineType
    points: Points


@dataclass(frozen=True)
class Zone(Feature):
    """A polygon: closed rings (n, 2) in metres, the outer one first; inner ones are holes."""

    type: RegionType
    rings: tuple[Points, ...]

    def contains(self, x: float, y: float) -> bool:
        (left, low), (right, high) = self.bounds
        if not (left <= x <= right and low <= y <= high):
            return False
        return bool(inside(self.rings, np.array([x]), np.array([y]))[0, 0])

    @cached_property
    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The least and the greatest x and y of all rings. Most places that are asked about are far from a zone."""
        points = np.vstack(self.rings)
        (left, low), (right, high) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        return (left, low), (right, high)


@dataclass(frozen=True)
class MapOverlays:
    """The typed features of a map, each kind in the order of the file. ``properties`` are those of the collection."""

    points: tuple[PointOfInterest, ...] = ()
    lines: tuple[Line, ...] = ()
    zones: tuple[Zone, ...] = ()
    properties: Properties = field(default_factory=dict)

    def points_of(self, *types: PointType) -> tuple[PointOfInterest, ...]:
        return tuple(point for point in self.points if point.type in types)

    def lines_of(self, *types: LineType) -> tuple[Line, ...]:
        return tuple(line for line in self.lines if line.type in types)

    def zones_of(self, *types: RegionType) -> tuple[Zone, ...]:
        return tuple(zone for zone in self.zones if zone.type in types)

    def point(self, feature_id: str) -> PointOfInterest | None:
        return next((point for point in self.points if point.id == feature_id), None)

    def zone(self, feature_id: str) -> Zone | None:
        return next((zone for zone in self.zones if zone.id == feature_id), None)

    def nearest_point(self, kind: PointType, x: float, y: float, within: float = math.inf) -> PointOfInterest | None:
        """The point of a type nearest to a place, at most ``within`` metres away."""
        nearest = min(self.points_of(kind), key=lambda p: math.hypot(p.x - x, p.y - y), default=None)
        return nearest if nearest is not None and math.hypot(nearest.x - x, nearest.y - y) <= within else None


def parse_overlays(overlays: maps.Overlays) -> MapOverlays:
    """Raises ``OverlayError`` at the first broken feature."""
    if overlays.get("type") != "FeatureCollection":
        raise OverlayError("overlays.type", f"{overlays.get('type')!r}, want 'FeatureCollection'")
    features = overlays.get("features")
    if not isinstance(features, list):
        raise OverlayError("overlays.features", f"{type(features).__name__}, want a list")
    parsed = [_parse_feature(f"overlays.features[{index}]", feature) for index, feature in enumerate(features)]
    properties = overlays.get("properties")
    return MapOverlays(
        tuple(f for f in parsed if isinstance(f, PointOfInterest)),
        tuple(f for f in parsed if isinstance(f, Line)),
        tuple(f for f in parsed if isinstance(f, Zone)),
        properties if isinstance(properties, dict) else {},
    )


def inside(rings: Sequence[Points], x: NDArray[np.floating], y: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Whether the points (x[j], y[i]) of a mesh lie inside closed rings by the even-odd rule, (len(y), len(x))."""
    result = np.zeros((len(y), len(x)), dtype=np.bool_)
    for ring in rings:
        for (x0, y0), (x1, y1) in itertools.pairwise(ring):
            if y0 == y1:
                continue
            crosses = (y0 > y) != (y1 > y)
            # Halves and shares, so that no finite coordinate overflows.
            share = (0.5 * y[crosses, None] - 0.5 * y0) / (0.5 * y1 - 0.5 * y0)
            result[crosses] ^= x[None, :] < x0 * (1.0 - share) + x1 * share
    return result


def _parse_feature(where: str, feature: Any) -> Feature | None:
    if not isinstance(feature, dict) or feature.get("type") != "Feature":
        raise OverlayError(where, "want an object of type 'Feature'")
    properties = feature.get("properties")
    if not isinstance(properties, dict | None):
        raise OverlayError(f"{where}.properties", f"{type(properties).__name__}, want an object")
    try:
        return _parse_geometry(where, feature, properties or {})
    except OverlayError as error:
        name = (properties or {}).get("name") or feature.get("id")
        raise OverlayError(error.where, error.what + (f" (feature {name!r:.60})" if name else "")) from None


def _parse_geometry(where: str, feature: dict[str, Any], properties: Properties) -> Feature | None:
    geometry = feature.get("geometry")
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if not isinstance(geometry, dict) or not isinstance(kind, str) or kind not in _GEOMETRIES:
        raise OverlayError(f"{where}.geometry", f"type {kind!r}, want one of {', '.join(_GEOMETRIES)}")
    coordinates: Any = geometry.get("coordinates")
    depth, code_name = _GEOMETRIES[kind]
    _check_positions(f"{where}.geometry.coordinates", coordinates, depth)
    general = str(feature.get("id", "")), str(properties.get("name") or ""), properties
    code = _code(f"{where}.properties.{code_name}", properties.get(code_name))
    match kind:
        case "Point":
            yaw = _yaw(f"{where}.properties.yaw", properties.get("yaw"))
            known = code in frozenset(PointType)
            return PointOfInterest(*general, PointType(code), *_xy(coordinates), yaw) if known else None
        case "LineString":
            if len(coordinates) < 2:
                raise OverlayError(f"{where}.geometry.coordinates", f"{len(coordinates)} positions, want at least 2")
            line = np.array([_xy(position) for position in coordinates])
            return Line(*general, LineType(code), line) if code in frozenset(LineType) else None
        case _:
            rings = _closed_rings(f"{where}.geometry.coordinates", coordinates)
            return Zone(*general, RegionType(code), rings) if code in frozenset(RegionType) else None


def _check_positions(where: str, value: Any, depth: int) -> None:
    if not isinstance(value, list):
        raise OverlayError(where, f"{type(value).__name__}, want a list")
    if depth:
        for index, item in enumerate(value):
            _check_positions(f"{where}[{index}]", item, depth - 1)
    elif len(value) not in (2, 3) or not all(_is_finite(number) for number in value):
        raise OverlayError(where, f"{value!r:.60}, want x, y in metres")


def _closed_rings(where: str, coordinates: list[list[list[float]]]) -> tuple[Points, ...]:
    """Rings may be open or closed in GeoJSON; here they are closed."""
    if not coordinates:
        raise OverlayError(where, "no ring, want at least 1")
    rings = []
    for index, ring in enumerate(coordinates):
        corners = [_xy(position) for position in ring]
        if len(set(corners)) < 3:
            raise OverlayError(f"{where}[{index}]", f"{len(set(corners))} different corners, want at least 3")
        rings.append(np.array(corners if corners[0] == corners[-1] else [*corners, corners[0]]))
    return tuple(rings)


def _code(where: str, value: Any) -> int:
    """The type code; 0, which no feature has, where there is none."""
    code = overlay_code(value)
    if code is None and value not in (None, ""):
        raise OverlayError(where, f"{value!r:.60}, want a type code such as 2 or '2'")
    return code or 0


def _yaw(where: str, degrees: Any) -> float | None:
    """Radians of degrees, which are written as a number or as a string."""
    if degrees in (None, ""):
        return None
    try:
        yaw = float(degrees) if isinstance(degrees, str) or _is_finite(degrees) else math.nan
    except ValueError:
        yaw = math.nan
    if not math.isfinite(yaw):
        raise OverlayError(where, f"{degrees!r:.60}, want degrees such as 90 or '90'")
    return math.radians(yaw)


def _xy(position: Sequence[float]) -> tuple[float, float]:
    return float(position[0]), float(position[1])


def _is_finite(number: Any) -> bool:
    """Whether it is a number of JSON that a float can hold: JSON has integers of any size."""
    if isinstance(number, bool) or not isinstance(number, int | float):
        return False
    return abs(number) <= sys.float_info.max
