"""``/robot-params``: what the chassis drives with. Keys and their order are those of a real robot."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import ConfigDict, Field

from rackhand.schemas import topics
from rackhand.schemas.parameters import (
    KEYS,
    DriveParameterChanges,
    DriveParameters,
    GetParameters,
    ParameterChanges,
    Parameters,
    ParametersReply,
    ParametersRequest,
    SetParameters,
)
from rackhand.services.gateway.context import Context, Gateway
from rackhand.services.gateway.http.errors import BadRequest, failures, unavailable
from rackhand.services.gateway.ws.payloads import footprint

router = APIRouter(prefix="/robot-params", tags=["chassis"])

FOOTPRINT = "/robot/footprint"
_FOOTPRINT_TOLERANCE = 1e-3  # m; clients round what they read before they write it back

Outline = list[Annotated[list[float], Field(min_length=2, max_length=2)]]


def _key(name: str) -> str:
    return KEYS.get(name, FOOTPRINT)


class RobotParams(DriveParameters):
    """m/s, rad/s, m/s². The footprint has x to the robot's right and y to its front, in metres."""

    model_config = ConfigDict(alias_generator=_key)
    footprint: Outline


class RobotParamsBody(DriveParameterChanges):
    """New values of some parameters; the others stay."""

    model_config = ConfigDict(
        alias_generator=_key,
        json_schema_extra={"examples": [{KEYS["max_forward_velocity"]: 0.8, KEYS["bump_tolerance"]: 0.5}]},
    )
    footprint: Outline | None = None


@router.get("", responses=failures(404, 503))
async def robot_params(gateway: Gateway) -> RobotParams:
    """The parameters in force."""
    outline = described_outline(gateway)
    return _shown((await ask_parameters(gateway, GetParameters())).values, outline)


@router.post("", responses=failures(400, 404, 413, 503))
async def set_robot_params(body: RobotParamsBody, gateway: Gateway) -> RobotParams:
    """Change parameters, within the limits of the chassis: all of those given, or none. They take effect at once, also
    for a running move, and persist. Answered with all parameters in force.
    """
    outline = described_outline(gateway)
    check_outline(FOOTPRINT, body.footprint, outline)
    changes = ParameterChanges(**body.model_dump(exclude={"footprint"}, exclude_none=True))
    request = SetParameters(changes=changes, names="robot_params")
    return _shown((await ask_parameters(gateway, request)).values, outline)


@router.get("/default", responses=failures(404, 503))
async def default_robot_params(gateway: Gateway) -> RobotParams:
    """The parameters as nobody has changed them; those of velocity and acceleration are the limits of the chassis."""
    outline = described_outline(gateway)
    return _shown((await ask_parameters(gateway, GetParameters())).defaults, outline)


async def ask_parameters(gateway: Context, request: GetParameters | SetParameters) -> ParametersReply:
    return await gateway.ask(topics.CHASSIS_PARAMETERS, ParametersRequest(request=request))


def described_outline(gateway: Context) -> Outline:
    """The body of the chassis in this API's frame. Raises ``HTTPException`` (503) until its driver has described it."""
    robot = gateway.chassis
    model = gateway.state.facts.newest(topics.CHASSIS_MODEL)
    if model is None:
        raise unavailable(f"the driver of {robot} has not described the chassis yet")
    return [list(corner) for corner in footprint(model.footprint)]


def check_outline(key: str, given: Outline | None, outline: Outline) -> None:
    """Raises ``BadRequest`` for another outline than the one that is there."""
    if given is not None and not _equal(given, outline):
        raise BadRequest(f"{key}: is that of the robot's description and cannot be changed here")


def _equal(given: Outline, outline: Outline) -> bool:
    return len(given) == len(outline) and all(
        abs(a - b) <= _FOOTPRINT_TOLERANCE
        for corner, own in zip(given, outline, strict=True)
        for a, b in zip(corner, own, strict=True)
    )


def _shown(values: Parameters, outline: Outline) -> RobotParams:
    fields: dict[str, Any] = {key: getattr(values, name) for name, key in KEYS.items()}
    return RobotParams(**(fields | {FOOTPRINT: outline}))
