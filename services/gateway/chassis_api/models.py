"""What travels over HTTP: bodies taken, objects returned. Key order is that of a real robot."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import MapData, MapSummary, Overlays
from rackhand.schemas.moves import Move, MoveCreate, MoveType

MAX_ID = 2**63 - 1
Name = Annotated[str, Field(max_length=1000)]


class Body(BaseModel):
    """A request body: strict about what it knows; what it does not know is ignored, as on a real robot."""

    model_config = ConfigDict(strict=True, extra="ignore", allow_inf_nan=False, frozen=True)


class MoveBody(Body):
    """A move to create. Metres, radians, map frame."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"creator": "docs", "type": "standard", "target_x": 4.0, "target_y": 2.5, "target_ori": 1.57},
                {"creator": "docs", "type": "standard", "target_ori": 0.0, "properties": {"inplace_rotate": True}},
            ]
        }
    )
    creator: Name = "control_unit"
    type: MoveType = "none"
    target_x: float | None = None
    target_y: float | None = None
    target_z: float | None = None
    target_ori: float | None = None
    target_accuracy: Annotated[float, Field(ge=0)] | None = None
    use_target_zone: bool | None = None
    route_coordinates: Annotated[str, Field(max_length=100_000)] | None = None
    detour_tolerance: Annotated[float, Field(ge=0)] | None = None
    charge_retry_count: Annotated[int, Field(ge=0, le=1_000_000)] | None = 0
    rack_area_id: Name | None = None
    properties: dict[str, Any] | None = Field(default=None, description="kept and returned as sent")

    def to_message(self) -> MoveCreate:
        fields = self.model_dump()
        fields["charge_retry_count"] = self.charge_retry_count or 0
        fields["properties"] = self.properties or {}
        return MoveCreate(**fields)


class MoveShort(BaseModel):
    """A row of the list of moves."""

    id: int
    creator: str
    state: str
    type: str
    fail_reason: int
    fail_reason_str: str
    fail_message: str
    create_time: int
    last_modified_time: int

    @classmethod
    def of(cls, move: Move) -> MoveShort:
        return cls(**_record(move, set(cls.model_fields)))


class MoveFull(BaseModel):
    """A move as it is kept."""

    id: int
    creator: str
    state: str = Field(examples=["moving"])
    type: str
    target_x: float | None
    target_y: float | None
    target_z: float | None
    target_ori: float | None
    target_accuracy: float | None
    use_target_zone: bool | None
    is_charging: bool | None
    charge_retry_count: int
    fail_reason: int
    fail_reason_str: str = Field(examples=["None - None"])
    fail_message: str
    create_time: int
    last_modified_time: int
    rack_area_id: str | None
    properties: dict[str, Any]

    @classmethod
    def of(cls, move: Move) -> MoveFull:
        return cls(**_record(move, set(cls.model_fields)))


def _record(move: Move, fields: set[str]) -> dict[str, Any]:
    return move.model_dump(include=fields) | {"fail_reason_str": fail_reason(move.fail_reason).rest_string}


def fail_reason(number: int) -> MoveFailReason:
    """A number this gateway does not know (of a newer planner, say) counts as unknown."""
    try:
        return MoveFailReason(number)
    except ValueError:
        return MoveFailReason.UNKNOWN


class CancelBody(Body):
    """The one change a move knows."""

    state: Literal["cancelled"]


class Cancelled(BaseModel):
    state: Literal["cancelled"] = "cancelled"


class Empty(BaseModel):
    """``{}``: done."""


class Help(BaseModel):
    message: str


class PoseBody(Body):
    """Where the robot is, in metres and radians of the current map."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"position": [1.0, 2.0, 0.0], "ori": 1.57}]})
    position: Annotated[list[float], Field(min_length=2, max_length=3)]
    ori: float
    adjust_position: bool | None = None


class ControlModeBody(Body):
    """``mode`` is what many clients send for ``control_mode``."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"control_mode": "auto"}]})
    control_mode: Literal["auto", "manual", "remote"] | None = None
    mode: Literal["auto", "manual", "remote"] | None = None


class EmergencyStopBody(Body):
    enable: bool


class ChassisStatusReply(BaseModel):
    control_mode: str
    emergency_stop_pressed: bool
    wheel_overloaded: bool = False


class MapIdentity(BaseModel):
    """The map in use. ``id`` is -1 for one that was given whole and not stored."""

    id: int
    uid: str
    map_name: str
    create_time: int
    map_version: int
    overlays_version: int

    @classmethod
    def of(cls, summary: MapSummary) -> MapIdentity:
        return cls(**summary.model_dump(include=set(cls.model_fields)))


class MapRow(MapIdentity):
    """A row of the map store. URLs name the host that was asked."""

    thumbnail_url: str
    image_url: str
    url: str
    last_modified_time: int

    @classmethod
    def at(cls, summary: MapSummary, root: str) -> MapRow:
        fields = summary.model_dump(include=set(cls.model_fields))
        return cls(**fields, **_urls(summary.id, root))


class MapDetail(MapRow):
    """A stored map. ``overlays`` is GeoJSON written as a string."""

    grid_origin_x: float
    grid_origin_y: float
    grid_resolution: float
    overlays: str
    pbstream_url: str | None
    download_url: str


def _urls(map_id: int, root: str) -> dict[str, str]:
    url = f"{root}/maps/{map_id}"
    return {"thumbnail_url": f"{url}/thumbnail", "image_url": f"{url}.png", "url": url}


def map_detail(data: MapData, root: str, overlays: str) -> MapDetail:
    row = MapRow.at(data, root)
    return MapDetail(
        **row.model_dump(),
        grid_origin_x=data.origin[0],
        grid_origin_y=data.origin[1],
        grid_resolution=data.resolution,
        overlays=overlays,
        pbstream_url=None,
        download_url=f"{row.url}/download",
    )


class MapBody(Body):
    """A map to store: ``occupancy_grid`` is a base64 8-bit grey PNG, the origin its lower-left corner in metres."""

    map_name: Name
    occupancy_grid: str
    grid_origin_x: float
    grid_origin_y: float
    grid_resolution: Annotated[float, Field(gt=0)]
    overlays: str | Overlays | None = Field(default=None, description="GeoJSON, as a string or an object")
    uid: Name | None = None


class MapPatchBody(Body):
    map_name: Name | None = None
    overlays: str | Overlays | None = None


class CurrentMapBody(Body):
    """A stored map by ``map_id`` or ``map_uid``, or a map given whole."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"map_id": 1}]})
    map_id: Annotated[int, Field(ge=-MAX_ID, le=MAX_ID)] | None = None
    map_uid: Name | None = None
    map_name: Name | None = None
    occupancy_grid: str | None = None
    grid_origin_x: float | None = None
    grid_origin_y: float | None = None
    grid_resolution: Annotated[float, Field(gt=0)] | None = None
    overlays: str | Overlays | None = None
    data_url: str | None = None
