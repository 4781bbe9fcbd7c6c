"""``/ros/map``: overlays of the map in use, changed while the robot drives, and zones that traffic control closes."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field

from rackhand.schemas import topics
from rackhand.schemas.maps import ANSWER_SECONDS, ChangeOverlays, GetMap, MapData, MapRequest, Overlays, RegionType
from rackhand.schemas.moves import Name
from rackhand.services.gateway.chassis_api.models import Body
from rackhand.services.gateway.context import Context, Gateway
from rackhand.services.gateway.http.errors import BadRequest, failures, not_found

router = APIRouter(prefix="/ros/map", tags=["maps"])

CLOSED = "traffic:"  # how the ids of features begin that are zones of traffic control

Corner = Annotated[list[float], Field(min_length=2, max_length=2)]


class NoPassingZone(Body):
    """A polygon that must not be driven into, corners x, y in metres. ``time_rules`` are not supported: a zone is
    closed for as long as it is in the list."""

    id: Name
    polygon: Annotated[list[Corner], Field(min_length=3, max_length=100)]
    time_rules: list[Any] | None = None


class TrafficInfo(Body):
    """The zones that are closed; ``map_uid``, where it is given, must be that of the map in use."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"version": 1, "no_passing_zones": [{"id": "a", "polygon": [[1, 1], [2, 1], [2, 2]]}]}]
        }
    )
    version: int = 1
    map_uid: Name | None = None
    no_passing_zones: list[NoPassingZone] = Field(default_factory=list, max_length=100)


class Changed(BaseModel):
    success: bool = True
    message: str = ""


class OverlaysBody(Body):
    """A GeoJSON FeatureCollection."""

    model_config = ConfigDict(
        extra="allow", json_schema_extra={"examples": [{"type": "FeatureCollection", "features": []}]}
    )
    type: str
    features: list[Any]


@router.get("/overlays", responses=failures(404, 503))
async def live_overlays(gateway: Gateway) -> dict[str, Any]:
    """The overlays of the map in use, as GeoJSON; 404 without a map."""
    overlays = (await _current(gateway)).overlays
    return overlays | {"features": [one for one in overlays.get("features", []) if not _is_traffic(one)]}


@router.put("/overlays", responses=failures(400, 404, 413, 503))
async def change_live_overlays(body: OverlaysBody, gateway: Gateway) -> Changed:
    """Put these in place of the overlays of the map in use, at once: the pose is kept and a running move goes on, round
    what is new. The stored map gets them too."""
    kept = [one for one in (await _current(gateway)).overlays.get("features", []) if _is_traffic(one)]
    given = body.model_dump()
    return await _change(gateway, given | {"features": [*given["features"], *kept]})


@router.get("/traffic_info", responses=failures(404, 503))
async def traffic_info(gateway: Gateway) -> dict[str, Any]:
    """The zones that are closed."""
    data = await _current(gateway)
    zones = [
        {"id": str(one["id"]).removeprefix(CLOSED), "polygon": one["geometry"]["coordinates"][0], "time_rules": []}
        for one in data.overlays.get("features", [])
        if _is_traffic(one)
    ]
    return {"version": 1, "map_uid": data.uid, "no_passing_zones": zones}


@router.put("/traffic_info", responses=failures(400, 404, 413, 503))
async def change_traffic_info(body: TrafficInfo, gateway: Gateway) -> Changed:
    """Close these zones and open all others, at once, also for a running move."""
    data = await _current(gateway)
    if body.map_uid not in (None, data.uid):
        raise BadRequest(f"map_uid: {body.map_uid!r} is not in use; that is {data.uid!r}")
    for zone in body.no_passing_zones:
        if zone.time_rules:
            raise BadRequest(f"no_passing_zones: {zone.id!r} has time_rules; want none, zones are closed while listed")
    others = [one for one in data.overlays.get("features", []) if not _is_traffic(one)]
    zones = [_feature(zone) for zone in body.no_passing_zones]
    return await _change(gateway, data.overlays | {"features": [*others, *zones]})


def _feature(zone: NoPassingZone) -> dict[str, Any]:
    ring = [list(corner) for corner in zone.polygon]
    if ring[0] != ring[-1]:
        ring.append(ring[0])
    return {
        "type": "Feature",
        "id": f"{CLOSED}{zone.id}",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": {"regionType": int(RegionType.NO_GO), "name": zone.id, "blocked": False},
    }


def _is_traffic(feature: Any) -> bool:
    return isinstance(feature, dict) and str(feature.get("id", "")).startswith(CLOSED)


async def _change(gateway: Context, overlays: Overlays) -> Changed:
    reply = await gateway.ask(topics.MAPS, MapRequest(request=ChangeOverlays(overlays=overlays)), ANSWER_SECONDS)
    version = None if reply.data is None else reply.data.overlays_version
    return Changed(message=f"overlays version {version} is in use")


async def _current(gateway: Context) -> MapData:
    reply = await gateway.ask(topics.MAPS, MapRequest(request=GetMap()))
    if reply.data is None:
        raise not_found("no map is in use")
    return reply.data
