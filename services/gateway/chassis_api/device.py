"""The device: what it is, what it can do, and how far it has booted."""

from __future__ import annotations

import asyncio
import math
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel

from rackhand.schemas import topics
from rackhand.schemas.chassis import ChassisModel
from rackhand.services.gateway.build import git_info
from rackhand.services.gateway.context import Gateway
from rackhand.services.gateway.http.errors import failures, unavailable
from rackhand.services.gateway.presence import Services
from rackhand.services.gateway.state import RobotState
from rackhand.services.gateway.ws.payloads import footprint

router = APIRouter(prefix="/device", tags=["device"])

# What this server does for every chassis, and what more for one with a jack, in the API's words.
CAPS = (
    "supportsWsV2",
    "supportsWheelStateTopic",
    "supportsSetControlModeService",
    "supportsSetEmergencyStopService",
    "supportsEnableTopicList",
    "supportsCachedTopics",
    "supportsSystemSettings",
)
JACK_CAPS = ("supportsJack", "supportsJackCheck", "supportsCrawling", "supportsDynamicFootprints")


class BootLog(BaseModel):
    stamp: float
    progress: float
    msg: str


class BootProgress(BaseModel):
    """``progress`` is the share of the expected services that are up."""

    start_time: float
    progress: float
    logs: list[BootLog]


@router.get("/info", responses=failures(404, 503))
async def device_info(gateway: Gateway) -> dict[str, Any]:
    """What this robot is. 503 until its driver has published its model."""
    robot = gateway.chassis
    model = gateway.state.facts.newest(topics.CHASSIS_MODEL)
    if model is None:
        raise unavailable(f"the driver of {robot} has not published its model yet")
    gitinfo = await asyncio.to_thread(git_info)  # the first call runs git
    return {**device_info_brief(gateway.state), "robot": _robot(model), "caps": _caps(model), "gitinfo": gitinfo}


@router.get("/info/brief", responses=failures())
async def device_brief(gateway: Gateway) -> dict[str, Any]:
    return device_info_brief(gateway.state)


@router.get("/boot_progress", responses=failures())
async def boot_progress(gateway: Gateway) -> BootProgress:
    """How much of the cell is up. Always 200."""
    services = gateway.services
    return BootProgress(start_time=services.started, progress=services.progress, logs=_boot_logs(services))


def _boot_logs(services: Services) -> list[BootLog]:
    return [
        BootLog(stamp=known.since, progress=services.progress, msg=f"{service} is {'up' if known.alive else 'down'}")
        for service, known in sorted(services.known.items(), key=lambda item: item[1].since)
    ]


def device_info_brief(state: RobotState) -> dict[str, Any]:
    model = state.facts.newest(topics.CHASSIS_MODEL)
    name = model.name if model is not None else "unknown"
    return {
        "rosversion": "",
        "rosdistro": "",
        "axbot_version": _version(),
        "device": {"model": name, "sn": state.robot, "name": state.robot},
        "baseboard": {"firmware_version": _version()},
        "wheel_control": {"device_type": "differential", "firmware_version": _version()},
        "lidar": {"model": "2d"},
        "bottom_sensor_pack": {"firmware_version": ""},
        "depth_camera": {"firmware_version": ""},
        "remote_params": {"tags": []},
    }


def _caps(model: ChassisModel) -> dict[str, bool]:
    return dict.fromkeys(CAPS, True) | dict.fromkeys(JACK_CAPS, model.jack is not None)


def _robot(model: ChassisModel) -> dict[str, Any]:
    return {
        "footprint": footprint(model.footprint),
        "inscribed_radius": round(inscribed_radius(model.footprint), 4),
        "height": model.height,
        "thickness": round(model.thickness, 4),
        "width": round(model.width, 4),
        "wheel_distance": model.wheel_separation,
        **_charge_contact(model),
    }


def _charge_contact(model: ChassisModel) -> dict[str, Any]:
    """Where the contacts are and which direction they face, as this API counts: x to the right, y to the front.

    Nothing for a chassis without contacts.
    """
    if model.charge_contact == "none":
        return {}
    at_front = model.charge_contact == "front"
    reach = float(model.footprint[:, 0].max() if at_front else model.footprint[:, 0].min())
    facing = math.pi / 2 if at_front else -math.pi / 2
    return {
        "charge_contact": {"pose_2d": [0.0, round(reach, 4), round(facing, 4)]},
        "charge_contact_position": model.charge_contact,
    }


def inscribed_radius(corners: np.ndarray[Any, Any]) -> float:
    """Distance from the chassis' origin to the nearest edge of its outline, in metres."""
    distances = [
        _distance_to_edge(begin, end) for begin, end in zip(corners, np.roll(corners, -1, axis=0), strict=True)
    ]
    return min(distances, default=0.0)


def _distance_to_edge(begin: np.ndarray[Any, Any], end: np.ndarray[Any, Any]) -> float:
    edge = end - begin
    length_squared = float(edge @ edge)
    along = 0.0 if length_squared == 0 else min(max(float(-begin @ edge) / length_squared, 0.0), 1.0)
    return math.hypot(*(begin + along * edge))


def _version() -> str:
    try:
        return version("rackhand")
    except PackageNotFoundError:  # run from a bare source tree
        return "0"
