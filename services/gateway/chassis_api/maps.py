"""The robot's map store, and the map in use."""

from __future__ import annotations

import base64
import binascii
import io
import json
import zipfile
from typing import Annotated, Any

from fastapi import APIRouter, Path, Request
from fastapi.responses import Response
from starlette.concurrency import run_in_threadpool

from rackhand.schemas import topics
from rackhand.schemas.maps import (
    ANSWER_SECONDS,
    CreateMap,
    DeleteMap,
    GetMap,
    ListMaps,
    MapData,
    MapReply,
    MapRequest,
    MapSummary,
    Overlays,
    PatchMap,
    ReplaceMap,
    SelectMap,
    UseMapData,
)
from rackhand.services.gateway.chassis_api.models import (
    MAX_ID,
    CurrentMapBody,
    MapBody,
    MapDetail,
    MapIdentity,
    MapPatchBody,
    MapRow,
    NewMapBody,
    map_detail,
)
from rackhand.services.gateway.context import Context, Gateway, root_of
from rackhand.services.gateway.http.bodies import MalformedJson, read_json
from rackhand.services.gateway.http.errors import BadRequest, failures, not_found
from rackhand.services.gateway.mapping import RESOLUTION

router = APIRouter(tags=["maps"])

MapId = Annotated[int, Path(ge=0, le=MAX_ID)]
_Responses = dict[int | str, dict[str, Any]]
_PNG: _Responses = {200: {"content": {"image/png": {"schema": {"type": "string", "format": "binary"}}}}}
# Fields of a map that are numbers, in a form too.
NUMBERS = ("grid_origin_x", "grid_origin_y", "grid_resolution", "map_version", "overlays_version")
_BINARY: _Responses = {
    200: {"content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}}
}
_ZIP: _Responses = {200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}}}


@router.get("/maps", responses=failures(503))
async def list_maps(request: Request, gateway: Gateway) -> list[MapRow]:
    reply = await _ask(gateway, MapRequest(request=ListMaps()))
    return [MapRow.at(summary, root_of(request, gateway)) for summary in reply.maps]


@router.post("/maps", status_code=201, responses=failures(400, 413, 503))
async def create_map(body: NewMapBody, request: Request, gateway: Gateway) -> MapRow:
    """Store a map. It is not used until ``POST /chassis/current-map`` selects it. Also as
    ``multipart/form-data``, or with the ``mapping_id`` of a finished mapping in place of the pictures.
    """
    given = body if body.mapping_id is None else _of_mapping(gateway, body, body.mapping_id)
    created = await run_in_threadpool(_to_create, given)
    return MapRow.at(_one(await _ask(gateway, MapRequest(request=created))), root_of(request, gateway))


@router.delete("/maps", status_code=204, responses=failures(503))
async def delete_all_maps(gateway: Gateway) -> None:
    reply = await _ask(gateway, MapRequest(request=ListMaps()))
    for summary in reply.maps:
        await _ask(gateway, MapRequest(request=DeleteMap(id=summary.id)))


@router.get("/maps/{map_id}.png", response_class=Response, responses={**_PNG, **failures(404, 503)})
async def map_image(map_id: MapId, gateway: Gateway) -> Response:
    """The occupancy grid: its row 0 is the top."""
    return Response((await _whole(gateway, map_id)).png, media_type="image/png")


@router.get("/maps/{map_id}.pbstream", response_class=Response, responses={**_BINARY, **failures(404, 503)})
async def map_file(map_id: MapId, gateway: Gateway) -> Response:
    """The file that was given in ``carto_map``, as it was; 404 for a map without one."""
    data = await _whole(gateway, map_id)
    if not data.carto_map:
        raise not_found(f"map {map_id} was stored without carto_map")
    return Response(base64.b64decode(data.carto_map), media_type="application/octet-stream")


@router.get("/maps/{map_id}/thumbnail", response_class=Response, responses={**_PNG, **failures(404, 503)})
async def map_thumbnail(map_id: MapId, gateway: Gateway) -> Response:
    return Response((await _whole(gateway, map_id)).png, media_type="image/png")


@router.get("/maps/{map_id}/download", response_class=Response, responses={**_ZIP, **failures(404, 503)})
async def download_map(map_id: MapId, gateway: Gateway) -> Response:
    """A ZIP of the PNG and a YAML file of the same name with everything else."""
    data = await _whole(gateway, map_id)
    headers = {"content-disposition": f'attachment; filename="map_{map_id}.zip"'}
    return Response(await run_in_threadpool(_archive, data), media_type="application/zip", headers=headers)


@router.get("/maps/{map_id}", responses=failures(404, 503))
async def get_map(map_id: MapId, request: Request, gateway: Gateway) -> MapDetail:
    data = await _whole(gateway, map_id)
    return map_detail(data, root_of(request, gateway), json.dumps(data.overlays, ensure_ascii=False))


@router.put("/maps/{map_id}", responses=failures(400, 404, 413, 503))
async def replace_map(map_id: MapId, body: MapBody, request: Request, gateway: Gateway) -> MapRow:
    """Overwrite a stored map. The map in use stays as it is until ``POST /chassis/current-map`` selects it again."""
    whole = await run_in_threadpool(_to_create, body)
    replaced = ReplaceMap(id=map_id, map=whole)
    return MapRow.at(_one(await _ask(gateway, MapRequest(request=replaced))), root_of(request, gateway))


@router.patch("/maps/{map_id}", responses=failures(400, 404, 413, 503))
async def patch_map(map_id: MapId, body: MapPatchBody, request: Request, gateway: Gateway) -> MapRow:
    """New name, overlays or versions. New overlays without a version get the next one. The map in use keeps its old
    ones until it is selected again.
    """
    patch = PatchMap(
        id=map_id,
        map_name=body.map_name,
        overlays=None if body.overlays is None else _overlays(body.overlays),
        map_version=body.map_version,
        overlays_version=body.overlays_version,
    )
    return MapRow.at(_one(await _ask(gateway, MapRequest(request=patch))), root_of(request, gateway))


@router.delete("/maps/{map_id}", status_code=204, responses=failures(400, 404, 503))
async def delete_map(map_id: MapId, gateway: Gateway) -> None:
    await _ask(gateway, MapRequest(request=DeleteMap(id=map_id)))


@router.get("/chassis/current-map", responses=failures(404, 503))
async def current_map(gateway: Gateway) -> MapIdentity:
    """The map in use; 404 when there is none."""
    return MapIdentity.of(_one(await _ask(gateway, MapRequest(request=GetMap()))))


@router.post("/chassis/current-map", responses=failures(400, 404, 413, 503))
async def choose_current_map(body: CurrentMapBody, gateway: Gateway) -> MapIdentity:
    """Use a stored map, or one given whole. A move that runs fails with ``map_changed``."""
    request = await run_in_threadpool(_to_choice, body)
    return MapIdentity.of(_one(await _ask(gateway, MapRequest(request=request))))


async def _ask(gateway: Context, request: MapRequest) -> MapReply:
    reads = isinstance(request.request, GetMap | ListMaps)
    return await gateway.ask(topics.MAPS, request, None if reads else ANSWER_SECONDS)


async def _whole(gateway: Context, map_id: int) -> MapData:
    reply = await _ask(gateway, MapRequest(request=GetMap(id=map_id)))
    if reply.data is None:
        raise not_found(f"there is no map {map_id}")
    return reply.data


def _one(reply: MapReply) -> MapSummary:
    if reply.data is not None:
        return reply.data
    if not reply.maps:
        raise not_found("there is no such map")
    return reply.maps[0]


def _of_mapping(gateway: Context, body: NewMapBody, mapping_id: int) -> MapBody:
    run = gateway.state.facts.mappings.runs.get(mapping_id)
    if run is None or run.state != "finished":
        state = "there is none" if run is None else f"it is {run.state}"
        raise BadRequest(f"mapping_id: {mapping_id} is not a finished mapping: {state}")
    x, y = run.origin
    return MapBody(
        map_name=body.map_name,
        occupancy_grid=base64.b64encode(run.png()).decode(),
        grid_origin_x=x,
        grid_origin_y=y,
        grid_resolution=RESOLUTION,
        map_version=1,
        overlays_version=1,
    )


def _to_create(body: MapBody) -> CreateMap:
    return CreateMap(
        map_name=body.map_name,
        uid=body.uid,
        png=_decoded("occupancy_grid", body.occupancy_grid),
        origin=(body.grid_origin_x, body.grid_origin_y),
        resolution=body.grid_resolution,
        map_version=body.map_version or 0,
        overlays_version=body.overlays_version or 0,
        overlays=_overlays({"type": "FeatureCollection", "features": []} if body.overlays is None else body.overlays),
        carto_map=_checked_base64("carto_map", body.carto_map or ""),
    )


def _to_choice(body: CurrentMapBody) -> SelectMap | UseMapData:
    if body.map_id is not None or body.map_uid is not None:
        return SelectMap(id=body.map_id, uid=None if body.map_id is not None else body.map_uid)
    if body.data_url is not None:
        raise BadRequest("data_url: files on the robot cannot be read; give map_id, map_uid or the map itself")
    missing = [name for name in _WHOLE_MAP if getattr(body, name) is None]
    if len(missing) == len(_WHOLE_MAP):
        raise BadRequest("map_id, map_uid or a whole map must be provided")
    if missing:
        raise BadRequest(*(f"{name}: is missing; a whole map needs it" for name in missing))
    whole = MapBody(**{name: getattr(body, name) for name in (*_WHOLE_MAP, "overlays")}, uid=body.map_uid)
    return UseMapData(map=_to_create(whole))


_WHOLE_MAP = ("map_name", "occupancy_grid", "grid_origin_x", "grid_origin_y", "grid_resolution")


def _decoded(name: str, text: str) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise BadRequest(f"{name}: not base64: {error}") from None


def _checked_base64(name: str, text: str) -> str:
    _decoded(name, text)
    return text


def _overlays(value: str | Overlays) -> Overlays:
    """Overlays come as an object or, as the real API has it, as the text of one."""
    if isinstance(value, str):
        try:
            value = read_json(value)
        except MalformedJson as error:
            raise BadRequest(f"overlays: {error}") from None
    if not isinstance(value, dict):
        raise BadRequest(f"overlays: want a GeoJSON object, got {type(value).__name__}")
    return value


def _archive(data: MapData) -> bytes:
    facts = {
        "uid": data.uid,
        "map_name": data.map_name,
        "grid_origin_x": data.origin[0],
        "grid_origin_y": data.origin[1],
        "grid_resolution": data.resolution,
        "map_version": data.map_version,
        "overlays_version": data.overlays_version,
        "overlays": json.dumps(data.overlays),
    }
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr(f"map_{data.id}.png", data.png)
        archive.writestr(f"map_{data.id}.yaml", json.dumps(facts, indent=2))  # JSON is YAML
    return packed.getvalue()
