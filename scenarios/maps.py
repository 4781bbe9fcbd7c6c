"""The maps of a scenario: the one of the world as the gateway has it, with other overlays, or none."""

from __future__ import annotations

import base64
import json
import struct
import zlib
from collections.abc import Iterator
from typing import Any

from rackhand.scenarios.api import Api
from rackhand.worlds.data import Point, PoseTuple
from rackhand.worlds.scenario_model import MapChange

Json = dict[str, Any]
RESOLUTION = 0.05  # m, of blank maps
FREE = 254  # the grey of free ground


class Maps:
    """Changes the map in use over HTTP; ``restore`` brings back the one that was in use at first."""

    def __init__(self, api: Api) -> None:
        self._api = api
        self._id = int(api.ask("GET", "/chassis/current-map")["id"])
        self._stored = dict(api.ask("GET", f"/maps/{self._id}"))
        status, self._png = api.send("GET", f"/maps/{self._id}.png")
        assert status == 200, f"the picture of map {self._id}: status {status}"
        self._overlays = json.loads(self._stored["overlays"])

    def use(self, change: MapChange) -> None:
        """Use a map that is given whole and not stored."""
        self._api.ask("POST", "/chassis/current-map", self._body(change))

    def restore(self) -> None:
        """Use the map that was in use at first."""
        self._api.ask("POST", "/chassis/current-map", {"map_id": self._id})

    def _geometry(self) -> tuple[float, float, float]:
        stored = self._stored
        return stored["grid_origin_x"], stored["grid_origin_y"], stored["grid_resolution"]

    def _body(self, change: MapChange) -> Json:
        features = [*(self._overlays["features"] if change.keep and change.blank is None else ()), *overlays_of(change)]
        overlays = {"type": "FeatureCollection", "features": features}
        if change.blank is None:
            return _whole("changed by a scenario", self._png, self._geometry(), overlays)
        columns, rows = (round(side / RESOLUTION) for side in change.blank.size)
        geometry = (*change.blank.origin, RESOLUTION)
        return _whole("blank", blank_png(columns, rows), geometry, overlays)


def _whole(name: str, png: bytes, geometry: tuple[float, float, float], overlays: Json) -> Json:
    return {
        "map_name": name,
        "occupancy_grid": base64.b64encode(png).decode(),
        "carto_map": "",
        "grid_origin_x": geometry[0],
        "grid_origin_y": geometry[1],
        "grid_resolution": geometry[2],
        "overlays": json.dumps(overlays),
    }


def overlays_of(change: MapChange) -> Iterator[Json]:
    """The GeoJSON features that a change of the map adds."""
    for number, line in enumerate(change.walls):
        yield _feature(f"wall_{number}", "LineString", [list(point) for point in line], {"lineType": 2})
    for number, zone in enumerate(change.no_go):
        yield _feature(f"no_go_{number}", "Polygon", _ring(zone), {"regionType": 1, "blocked": False})
    for name, pose in change.rack_points.items():
        yield _point(name, pose, "34")
    for name, pose in change.chargers.items():
        yield _point(name, pose, "9")
    for name, zone in change.rack_areas.items():
        yield _feature(name, "Polygon", _ring(zone), {"regionType": "17", "name": name})


def _point(name: str, pose: PoseTuple, kind: str) -> Json:
    return _feature(name, "Point", list(pose[:2]), {"type": kind, "name": name, "yaw": pose[2]})


def _ring(zone: tuple[Point, ...]) -> list[list[list[float]]]:
    return [[list(point) for point in (*zone, zone[0])]]


def _feature(name: str, shape: str, coordinates: list[Any], properties: Json) -> Json:
    geometry = {"type": shape, "coordinates": coordinates}
    return {"type": "Feature", "id": name, "geometry": geometry, "properties": properties}


def blank_png(columns: int, rows: int) -> bytes:
    """A grey picture of free ground (RFC 2083: signature, header, one compressed block of rows, end)."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        checked = kind + content
        return struct.pack(">I", len(content)) + checked + struct.pack(">I", zlib.crc32(checked))

    header = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    data = zlib.compress((b"\0" + bytes([FREE]) * columns) * rows)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")
