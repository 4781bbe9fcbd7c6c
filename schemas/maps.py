"""Maps: the robot's store of them, the one in use, and its overlays (GeoJSON in map coordinates)."""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated, Any, Literal

from pydantic import Field

from rackhand.schemas.base import Message, Stamp, Vec2

Overlays = dict[str, Any]
"""A GeoJSON FeatureCollection. ``properties`` of a feature hold its type code under ``type`` (Point), ``lineType``
(LineString) or ``regionType`` (Polygon), as a number or as a string, and ``yaw`` in degrees."""
WORK_SECONDS = 30.0  # that checking and loading a map may take; a request that takes longer is refused
ANSWER_SECONDS = WORK_SECONDS + 5.0  # after which it has been answered in any case, and so have those behind it
Version = Annotated[int, Field(ge=0, lt=2**63)]


class PointType(IntEnum):
    """Points of interest: ``properties.type`` of a Point."""

    FAST_FOOD = 1
    DRINKS = 2
    OTHER = 3
    COMPANY = 4
    RESIDENCE = 5
    ELEVATOR = 6
    GATE = 7
    AUTO_DOOR = 8
    CHARGER = 9
    STANDBY = 10
    TABLE = 11
    PRIVATE_ROOM = 12
    BAR = 13
    PACKING = 14
    OUTLET = 15
    LOBBY = 16
    RESTAURANT = 17
    STORE = 18
    RECEPTION = 19
    HOUSE_NUMBER = 20
    ROOM = 21
    DESK = 22
    CABINET = 23
    WAYPOINT = 25
    DISINFECTION = 26
    EXCHANGE = 27
    ELEVATOR_WAITING = 28
    DISPATCH = 29
    DISTRIBUTION = 30
    PICK_UP_MATERIAL = 31
    SEND_MATERIAL = 32
    RECLAIM = 33
    RACK = 34
    DOCKING = 36
    BARCODE = 37
    LANDMARK = 39


class LineType(IntEnum):
    """``properties.lineType`` of a LineString."""

    VIRTUAL_TRACK = 1
    VIRTUAL_WALL = 2
    GUIDE_LINE = 3
    RACK_PATROL = 4


class RegionType(IntEnum):
    """``properties.regionType`` of a Polygon."""

    NO_GO = 1
    SLOW = 2
    ELEVATOR = 3
    GATE = 4
    AUTO_DOOR = 5
    DROP_RISK = 6
    SLOPE = 7
    LIDAR_DECEITFUL = 8
    NARROW = 9
    EXCLUSIVE = 10
    RESTAURANT = 11
    PASSABLE = 12
    CHARGING = 13
    LONG_TUNNEL_EXIT = 14
    DEPTH_RESTRICTED = 15
    KEEP_TO_CENTRE_LINE = 16
    RACK_ZONE = 17


def overlay_code(value: object) -> int | None:
    """A type code as clients write it, 17 or "17"; None for anything else."""
    if isinstance(value, str) and value.strip().isdecimal() and len(value) < 10:
        return int(value)
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value if isinstance(value, int) and not isinstance(value, bool) else None


class MapSummary(Message):
    """A row of the map store. Times are unix seconds. ``id`` is -1 for a map set from data and not stored."""

    id: int
    uid: str
    map_name: str
    create_time: int
    last_modified_time: int
    map_version: int = 0
    overlays_version: int = 0


class MapData(MapSummary):
    """A whole map: 8-bit grey PNG (occupied dark, free light, unknown between), lower-left corner, metres a cell.

    ``carto_map``: base64 of a file that belongs to the map for its makers; kept and given back, not read, and not part
    of the map in use.
    """

    png: bytes
    origin: Vec2
    resolution: Annotated[float, Field(gt=0)]
    overlays: Overlays = Field(default_factory=lambda: {"type": "FeatureCollection", "features": []})
    carto_map: str = ""


class CurrentMap(Message):
    """The map in use, or none; latched."""

    stamp: Stamp
    map: MapData | None = None


class ListMaps(Message):
    op: Literal["list"] = "list"


class GetMap(Message):
    """One map by id; without an id, the one in use."""

    op: Literal["get"] = "get"
    id: int | None = None


class CreateMap(Message):
    op: Literal["create"] = "create"
    map_name: str
    uid: str | None = None
    png: bytes
    origin: Vec2
    resolution: Annotated[float, Field(gt=0)]
    map_version: Version = 0
    overlays_version: Version = 0
    overlays: Overlays = Field(default_factory=lambda: {"type": "FeatureCollection", "features": []})
    carto_map: str = ""


class ReplaceMap(Message):
    """Overwrite a stored map with a whole one; it keeps its id, and its uid unless another is given. The map in use
    stays as it is until it is selected again.
    """

    op: Literal["replace"] = "replace"
    id: int
    map: CreateMap


class PatchMap(Message):
    """New name, overlays or versions; new overlays without a version get the next one. The map in use keeps its old
    ones until it is selected again (as measured).
    """

    op: Literal["patch"] = "patch"
    id: int
    map_name: str | None = None
    overlays: Overlays | None = None
    map_version: Version | None = None
    overlays_version: Version | None = None


class DeleteMap(Message):
    op: Literal["delete"] = "delete"
    id: int


class SelectMap(Message):
    """Use a stored map (by id or uid); with neither, use none. A running move fails with ``map_changed``."""

    op: Literal["select"] = "select"
    id: int | None = None
    uid: str | None = None


class UseMapData(Message):
    """Use a map that is given whole and not stored."""

    op: Literal["use_data"] = "use_data"
    map: CreateMap


class ChangeOverlays(Message):
    """Put these overlays in place of those of the map in use, at once: a running move goes on. The stored map that it
    is gets them too."""

    op: Literal["overlays"] = "overlays"
    overlays: Overlays


class MapRequest(Message):
    request: Annotated[
        ListMaps | GetMap | CreateMap | ReplaceMap | PatchMap | DeleteMap | SelectMap | UseMapData | ChangeOverlays,
        Field(discriminator="op"),
    ]


class MapReply(Message):
    """``maps``: rows of the store. ``data``: the one map that was asked for whole."""

    maps: tuple[MapSummary, ...] = Field(default=(), strict=False)
    data: MapData | None = None
