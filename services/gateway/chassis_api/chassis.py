"""The chassis: modes, stops, the jack, its pose and status."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from fastapi.responses import JSONResponse

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import (
    ChassisRequest,
    ClearJackErrors,
    DetectRacks,
    JackRequest,
    JackSelfCheck,
    SetControlMode,
    SetEmergencyStop,
    SetPose,
)
from rackhand.services.gateway.chassis_api.models import (
    ChargerPose,
    ChassisStatusReply,
    ControlModeBody,
    EmergencyStopBody,
    Empty,
    Help,
    JackReply,
    PoseBody,
    RackPose,
)
from rackhand.services.gateway.context import Context, Gateway
from rackhand.services.gateway.http.errors import BadRequest, failures, not_found, unavailable
from rackhand.services.gateway.ws.chargers import charger_pose
from rackhand.services.gateway.ws.payloads import jack_state, pose_frame
from rackhand.services.gateway.ws.rack_payloads import rack_pose

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


@router.get("/chassis/jack", responses=failures(404, 503))
async def jack(gateway: Gateway) -> JackReply:
    """The jack as on the WebSocket topic ``/jack_state``, and what the robot carries: for clients that poll (an
    extension). 404 on a chassis without a jack.
    """
    robot, facts = gateway.chassis, gateway.state.facts
    model, state, load = facts.newest(topics.CHASSIS_MODEL), jack_state(facts), facts.newest(topics.LOAD)
    if model is not None and model.jack is None:
        raise not_found(f"{robot} has no jack")
    if state is None or load is None:
        raise unavailable(f"the jack of {robot} has not been reported yet")
    return JackReply(**state.model_dump(), load=load.state)


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


@services.post("/jack_self_check", responses=_SERVICE)
async def jack_self_check(gateway: Gateway) -> JSONResponse:
    """Raise and lower the jack without a load, to find out whether it works; only with the jack down and no rack above
    the robot. Answered at once; `self_checking` and `self_check_state` are on the WebSocket topic ``/jack_state``.
    """
    return await _execute(gateway, ChassisRequest(request=JackSelfCheck()))


@services.post("/clear_jack_errors", responses=_SERVICE)
async def clear_jack_errors(gateway: Gateway) -> JSONResponse:
    """End the alerts of a jack that did not arrive in time or failed its self-check."""
    return await _execute(gateway, ChassisRequest(request=ClearJackErrors()))


@services.post("/start_rack_size_detection", responses=_SERVICE)
async def start_rack_size_detection(gateway: Gateway) -> JSONResponse:
    """Measure the rack in front of the robot while no move runs; what is found is on the WebSocket topic
    ``/detected_rack``, with its width and depth, whether or not `rack.specs` has this size.
    """
    return await _execute(gateway, ChassisRequest(request=DetectRacks(enable=True)))


@services.post("/stop_rack_size_detection", responses=_SERVICE)
async def stop_rack_size_detection(gateway: Gateway) -> JSONResponse:
    """End what ``/services/start_rack_size_detection`` began."""
    return await _execute(gateway, ChassisRequest(request=DetectRacks(enable=False)))


@services.get("/query_pose/rack_pose", responses=failures(404, 503))
async def query_rack_pose(gateway: Gateway) -> RackPose:
    """The pose in the map of the middle of the rack that the robot is under or carries; 404 without one."""
    robot = gateway.chassis
    if gateway.state.facts.newest(topics.LOAD) is None:
        raise unavailable(f"the planner of {robot} has not published yet what the robot carries")
    pose = rack_pose(gateway.state.facts)
    if pose is None:
        raise not_found("the robot neither carries a rack nor is it under one")
    return RackPose(pose=pose_frame(pose))


@services.get("/query_pose/charger_pose", responses=failures(404, 503))
async def query_charger_pose(gateway: Gateway) -> ChargerPose:
    """Where a robot on the charger's contacts is, in the map: as the scan showed it to the running or last move if that
    was a `charge`, else of the charger of the map nearest to the robot; 404 if the map has none.
    """
    facts = gateway.state.facts
    if facts.newest(topics.PLANNING_STATE) is None or facts.newest(topics.MAP) is None:
        raise unavailable(f"the planner of {gateway.chassis} has not published yet")
    pose = charger_pose(facts)
    if pose is None:
        raise not_found("no charger (overlay type 9) is registered on the map in use")
    return ChargerPose(pose=pose_frame(pose))


async def _execute(gateway: Context, request: ChassisRequest) -> JSONResponse:
    await gateway.ask(topics.CHASSIS_REQUEST, request)
    return JSONResponse({}, status_code=gateway.settings.service_status)
