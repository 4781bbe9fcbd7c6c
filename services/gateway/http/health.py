"""Who is there: one row a service."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel

from rackhand.schemas.service import CELL, ServiceId
from rackhand.services.gateway.context import Gateway
from rackhand.services.gateway.state import State

router = APIRouter(tags=["health"])

THIS = ServiceId("gateway", CELL)
Up = Literal["up", "down"]


class ServiceRow(BaseModel):
    """``since`` (unix seconds) is when its present state began; ``restarts``, how often it came back since this
    gateway began to watch.
    """

    service: str
    robot: str
    status: Up
    alive: bool
    expected: bool
    since: float | None
    restarts: int


class Health(BaseModel):
    status: Up
    services: list[ServiceRow]


@router.get("/healthz", responses={503: {"description": "An expected service is down", "model": Health}})
async def healthz(response: Response, gateway: Gateway) -> Health:
    """200 when every expected service is there, else 503."""
    health = read_health(gateway.state)
    if health.status == "down":
        response.status_code = 503
    return health


def read_health(state: State) -> Health:
    """The expected services first, then whoever else is or was there. This gateway is up, as it answers."""
    expected = dict.fromkeys((*state.expected, THIS))
    rows = [_row(state, service, service in expected) for service in dict.fromkeys((*expected, *state.services))]
    return Health(status="up" if state.all_up else "down", services=rows)


def _row(state: State, service: ServiceId, expected: bool) -> ServiceRow:
    known = state.services.get(service)
    alive = service == THIS or state.is_alive(service)
    since = state.started if service == THIS else known.since if known else None
    return ServiceRow(
        service=service.service,
        robot=service.robot,
        status="up" if alive else "down",
        alive=alive,
        expected=expected,
        since=since,
        restarts=0 if known is None or service == THIS else known.restarts,
    )
