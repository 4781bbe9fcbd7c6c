"""Bodies of HTTP requests and answers. Key order is that of a real robot."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from rackhand.schemas.chassis import CheckState
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import MapData, MapSummary, Overlays
from rackhand.schemas.moves import Move, MoveCreate, Name
from rackhand.schemas.racks import LoadState
from rackhand.schemas.websocket import PoseFrame

MAX_ID = 2**63 - 1
Version = Annotated[int, Field(ge=0, le=MAX_ID)]


class Body(BaseModel):
    """A request body: strict about the fields it knows; unknown ones are ignored, as on a real robot."""

    model_config = ConfigDict(strict=True, extra="ignore", allow_inf_nan=False, frozen=True)


_NULLABLE = ("charge_retry_count", "creator", "properties", "type")
_MOVES = [
    {"creator": "docs", "type": "standard", "target_x": 4.0, "target_y": 2.5, "target_ori": 1.57},
    {"creator": "docs", "type": "standard", "target_ori": 0.0, "properties": {"inplace_rotate": True}},
]


def _describe_move(schema: dict[str, Any]) -> None:
    """Examples, and the fields that clients may send as ``null`` though a stored move has a value."""
    schema["examples"] = _MOVES
    for name in _NULLABLE:
        schema["properties"][name] = {"anyOf": [schema["properties"][name], {"type": "null"}]}


class MoveBody(MoveCreate):
    """A move to create. Metres, radians, map frame. Unknown keys are ignored."""

    model_config = ConfigDict(extra="ignore", json_schema_extra=_describe_move)

    @model_validator(mode="before")
    @classmethod
    def _without_nulls(cls, given: Any) -> Any:
        """Clients send ``null`` for what they have no value for, and moves come back with such fields."""
        if not isinstance(given, dict):
            return given
        return {key: value for key, value in given.items() if value is not None or key not in _NULLABLE}

    def to_message(self) -> MoveCreate:
        return MoveCreate(**self.model_dump())


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
    """The stored move."""

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
    """A number unknown to this gateway (of a newer planner, say) counts as ``UNKNOWN``."""
    try:
        return MoveFailReason(number)
    except ValueError:
        return MoveFailReason.UNKNOWN


MoveChange = Literal["cancelled", "paused", "moving"]


class MoveChangeBody(Body):
    """What a running move is changed to. ``paused`` holds it still where it is until ``moving`` lets it go on; both are
    additions to the API of a real robot, whose moves can be cancelled only."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"state": "cancelled"}]})
    state: MoveChange


class MoveChanged(BaseModel):
    """What it was changed to."""

    state: MoveChange = Field(examples=["cancelled"])


class Empty(BaseModel):
    """``{}``: done."""


class Help(BaseModel):
    message: str


class PoseBody(Body):
    """A pose in metres and radians of the current map."""

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


class JackReply(BaseModel):
    """``progress``: 0 is down, 1 is up; ``weight`` in kg, as the jack's sensor reads it. ``load``: a rack counts as
    carried once the jack is up.
    """

    state: Literal["unknown", "hold", "jacking_up", "jacking_down"]
    progress: float
    self_checking: bool
    self_check_state: CheckState
    weight: float
    load: LoadState


class RackPose(BaseModel):
    """The middle of a rack, and the heading of a robot under it."""

    pose: PoseFrame


class ChargerPose(BaseModel):
    """The pose of a robot on the contacts of a charger."""

    pose: PoseFrame


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
        pbstream_url=f"{row.url}.pbstream" if data.carto_map else None,
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
    map_version: Version | None = None
    overlays_version: Version | None = None
    carto_map: str | None = Field(default=None, description="base64; kept and given back, not read")


_OF_MAPPING = {"occupancy_grid": "", "grid_origin_x": 0.0, "grid_origin_y": 0.0, "grid_resolution": 1.0}


class NewMapBody(MapBody):
    """A map given whole, or ``map_name`` and the ``mapping_id`` of a finished mapping, whose picture it gets."""

    mapping_id: Annotated[int, Field(ge=0, le=MAX_ID)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _without_a_picture(cls, given: Any) -> Any:
        if not isinstance(given, dict) or given.get("mapping_id") is None:
            return given
        return given | _OF_MAPPING


class MapPatchBody(Body):
    map_name: Name | None = None
    overlays: str | Overlays | None = None
    map_version: Version | None = None
    overlays_version: Version | None = None


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
