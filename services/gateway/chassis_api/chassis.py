"""The chassis: modes, stops, the jack, its pose and status."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from fastapi.responses import JSONResponse

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import ChassisRequest, JackRequest, SetControlMode, SetEmergencyStop, SetPose
from rackhand.services.gateway.chassis_api.models import (
    ChassisStatusReply,
    ControlModeBody,
    EmergencyStopBody,
    Empty,
    Help,
    PoseBody,
)
from rackhand.services.gateway.context import Context, Gateway
from rackhand.services.gateway.http.errors import BadRequest, failures, unavailable

router = APIRouter(tags=["chassis"])
services = APIRouter(prefix="/services", tags=["services"])

_DONE: dict[int | str, dict[str, Any]] = {
    200: {"description": "Done", "model": Empty},
    201: {"description": "Done, where so configured", "model": Empty},
}
_SERVICE = {**_DONE, **failures(400, 413, 503)}

POSE_HELP = (
    'POST {"position": [x, y, z], "ori": yaw} sets the robot\'s pose on the current map (metres, radians). '
    "Its present pose is published on the WebSocket topic /tracked_pose."
)


@router.get("/chassis/pose", responses=failures())
async def pose_help() -> Help:
    """How to set the pose. The present pose is on the WebSocket topic ``/tracked_pose``."""
    return Help(message=POSE_HELP)


@router.post("/chassis/pose", responses=failures(400, 413, 503))
async def set_pose(body: PoseBody, gateway: Gateway) -> Empty:
    """Set the robot's pose on the current map."""
    x, y = body.position[:2]
    await gateway.ask(topics.CHASSIS_REQUEST, ChassisRequest(request=SetPose(pose=Pose2(x=x, y=y, yaw=body.ori))))
    return Empty()


@router.get("/chassis/status", responses=failures(404, 503))
async def chassis_status(gateway: Gateway) -> ChassisStatusReply:
    robot = gateway.chassis
    status = gateway.state.facts.newest(topics.CHASSIS_STATUS)
    if status is None:
        raise unavailable(f"no chassis status from the planner of {robot} yet")
    return ChassisStatusReply(control_mode=status.control_mode, emergency_stop_pressed=status.emergency_stop)


@services.post("/wheel_control/set_control_mode", responses=_SERVICE)
async def set_control_mode(body: ControlModeBody, gateway: Gateway) -> JSONResponse:
    """``auto``: moves drive. ``remote``: ``/twist`` drives. ``manual``: nothing drives, the robot can be pushed."""
    mode = body.control_mode or body.mode
    if mode is None:
        raise BadRequest("control_mode: is missing; want auto, manual or remote")
    return await _execute(gateway, ChassisRequest(request=SetControlMode(control_mode=mode)))


@services.post("/wheel_control/set_emergency_stop", responses=_SERVICE)
async def set_emergency_stop(body: EmergencyStopBody, gateway: Gateway) -> JSONResponse:
    """Stop at once; the robot stays stopped until ``enable`` is false."""
    return await _execute(gateway, ChassisRequest(request=SetEmergencyStop(enable=body.enable)))


@services.post("/wheel_control/set_emergency_stop_pressed", responses=_SERVICE, include_in_schema=False)
async def set_emergency_stop_pressed(body: EmergencyStopBody, gateway: Gateway) -> JSONResponse:
    return await set_emergency_stop(body, gateway)


@services.post("/jack_up", responses=_SERVICE)
async def jack_up(gateway: Gateway) -> JSONResponse:
    """Answered at once; progress is on the WebSocket topic ``/jack_state``."""
    return await _execute(gateway, ChassisRequest(request=JackRequest(direction="up")))


@services.post("/jack_down", responses=_SERVICE)
async def jack_down(gateway: Gateway) -> JSONResponse:
    """Answered at once; progress is on the WebSocket topic ``/jack_state``."""
    return await _execute(gateway, ChassisRequest(request=JackRequest(direction="down")))


async def _execute(gateway: Context, request: ChassisRequest) -> JSONResponse:
    await gateway.ask(topics.CHASSIS_REQUEST, request)
    return JSONResponse({}, status_code=gateway.settings.service_status)
