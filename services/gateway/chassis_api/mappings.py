"""``/mappings``: draw a map from the scans of a drive. Runs are kept until the gateway ends; save them as maps."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Path, Request
from fastapi.responses import JSONResponse, Response
from pydantic import BaseModel, ConfigDict
from starlette.concurrency import run_in_threadpool

from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS, Pose2
from rackhand.services.gateway.chassis_api.models import MAX_ID, Body
from rackhand.services.gateway.context import Context, Gateway, root_of
from rackhand.services.gateway.http.errors import BadRequest, failures, not_found, unavailable
from rackhand.services.gateway.mapping import RESOLUTION, Mapping

router = APIRouter(prefix="/mappings", tags=["maps"])

MappingId = Annotated[int, Path(ge=0, le=MAX_ID)]
_PNG: dict[int | str, dict[str, Any]] = {
    200: {"content": {"image/png": {"schema": {"type": "string", "format": "binary"}}}}
}


class MappingBody(Body):
    """``zero``: the robot's present pose is the origin of the new map; ``current_pose``: the frame stays that of the
    map in use. Maps are not extended: ``continue_mapping`` true is refused."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"continue_mapping": False}]})
    continue_mapping: bool = False
    start_pose_type: Literal["zero", "current_pose"] = "zero"


class MappingEndBody(Body):
    model_config = ConfigDict(json_schema_extra={"examples": [{"state": "finished"}]})
    state: Literal["finished", "cancelled"]
    new_map_only: bool = False


class MappingRow(BaseModel):
    """A run. URLs are null until it has finished."""

    id: int
    thumbnail_url: str | None
    image_url: str | None
    grid_origin_x: float
    grid_origin_y: float
    grid_resolution: float
    url: str
    start_time: int
    end_time: int | None
    state: Literal["running", "finished", "cancelled", "failed"]
    bag_id: int | None = None
    bag_url: str | None = None
    download_url: str | None = None
    trajectories_url: str | None

    @classmethod
    def of(cls, run: Mapping, root: str) -> MappingRow:
        url, done = f"{root}/mappings/{run.id}", run.state == "finished"
        x, y = run.origin if done else (0.0, 0.0)
        return cls(
            id=run.id,
            thumbnail_url=f"{url}/thumbnail" if done else None,
            image_url=f"{url}.png" if done else None,
            grid_origin_x=x,
            grid_origin_y=y,
            grid_resolution=RESOLUTION if done else 0.0,
            url=url,
            start_time=run.start_time,
            end_time=run.end_time,
            state=run.state,
            trajectories_url=f"{url}/trajectories.json" if done else None,
        )


@router.post("", status_code=201, responses=failures(400, 413, 503))
async def start_mapping(body: MappingBody, request: Request, gateway: Gateway) -> MappingRow:
    """Begin to draw a map from the scans, at the poses of the localiser. One run at a time; drive the robot meanwhile,
    by moves or by ``/twist``."""
    if body.continue_mapping:
        raise BadRequest("continue_mapping: maps are not extended here; want false")
    pose = gateway.state.facts.newest(topics.POSE)
    if pose is None:
        raise unavailable(f"the pose of {gateway.chassis} is not known yet")
    start = pose.pose if body.start_pose_type == "zero" else Pose2(x=0.0, y=0.0, yaw=0.0)
    try:
        run = gateway.state.facts.mappings.begin(start, _now(gateway))
    except ValueError as error:
        raise BadRequest(str(error)) from None
    return MappingRow.of(run, root_of(request, gateway))


@router.get("", responses=failures())
async def list_mappings(request: Request, gateway: Gateway) -> list[MappingRow]:
    """Newest first."""
    root = root_of(request, gateway)
    return [MappingRow.of(run, root) for run in reversed(gateway.state.facts.mappings.runs.values())]


@router.delete("", status_code=204, responses=failures())
async def delete_all_mappings(gateway: Gateway) -> None:
    """A running one is dropped too."""
    gateway.state.facts.mappings.runs.clear()


@router.get("/current", responses=failures(404))
async def current_mapping(request: Request, gateway: Gateway) -> MappingRow:
    """The running one; 404 when there is none."""
    if (run := gateway.state.facts.mappings.running) is None:
        raise not_found("no mapping is running")
    return MappingRow.of(run, root_of(request, gateway))


@router.patch("/current", responses=failures(400, 404, 413))
async def end_mapping(body: MappingEndBody, request: Request, gateway: Gateway) -> MappingRow:
    """Finish or cancel the running one; 404 when there is none."""
    run = gateway.state.facts.mappings.running
    if run is None:
        raise not_found("no mapping is running")
    run.finish(body.state, _now(gateway))
    return MappingRow.of(run, root_of(request, gateway))


@router.get("/{mapping_id}.png", response_class=Response, responses={**_PNG, **failures(404)})
async def mapping_image(mapping_id: MappingId, gateway: Gateway) -> Response:
    """The map, of a running one as it is by now: its row 0 is the top."""
    return Response(await run_in_threadpool(_run(gateway, mapping_id).png), media_type="image/png")


@router.get("/{mapping_id}/thumbnail", response_class=Response, responses={**_PNG, **failures(404)})
async def mapping_thumbnail(mapping_id: MappingId, gateway: Gateway) -> Response:
    return await mapping_image(mapping_id, gateway)


@router.get("/{mapping_id}/trajectories.json", responses=failures(404))
async def mapping_trajectories(mapping_id: MappingId, gateway: Gateway) -> JSONResponse:
    """Where the robot drove, in the frame of the new map."""
    return JSONResponse([{"id": 0, "coordinates": [list(at) for at in _run(gateway, mapping_id).trajectory]}])


@router.get("/{mapping_id}", responses=failures(404))
async def get_mapping(mapping_id: MappingId, request: Request, gateway: Gateway) -> MappingRow:
    return MappingRow.of(_run(gateway, mapping_id), root_of(request, gateway))


@router.delete("/{mapping_id}", status_code=204, responses=failures(404))
async def delete_mapping(mapping_id: MappingId, gateway: Gateway) -> None:
    _run(gateway, mapping_id)
    del gateway.state.facts.mappings.runs[mapping_id]


def _run(gateway: Context, mapping_id: int) -> Mapping:
    run = gateway.state.facts.mappings.runs.get(mapping_id)
    if run is None:
        raise not_found(f"there is no mapping {mapping_id}")
    return run


def _now(gateway: Context) -> int:
    """Unix seconds of the newest measurement."""
    facts = gateway.state.facts
    odometry = facts.newest(topics.ODOMETRY)
    return int(facts.unix_ns(0 if odometry is None else odometry.stamp) // NANOSECONDS)
