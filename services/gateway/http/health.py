"""Liveliness: one row a service."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel

from rackhand.schemas.service import ServiceId
from rackhand.services.gateway.context import Gateway
from rackhand.services.gateway.presence import Services

router = APIRouter(tags=["health"])

Up = Literal["up", "down"]


class ServiceRow(BaseModel):
    """``since`` (unix seconds) is when its present state began; ``restarts``, how often it came back since this
    gateway was started: as a new process, or the same one whose connection to the bus was lost.
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
    """200 when every expected service is up, else 503."""
    health = read_health(gateway.services)
    if health.status == "down":
        response.status_code = 503
    return health


def read_health(services: Services) -> Health:
    """The expected services first, then all others that are or were up. This gateway is up, as it answers."""
    expected = dict.fromkeys((*services.expected, services.this))
    rows = [_row(services, service, service in expected) for service in dict.fromkeys((*expected, *services.known))]
    return Health(status="up" if services.all_up else "down", services=rows)


def _row(services: Services, service: ServiceId, expected: bool) -> ServiceRow:
    known = services.known.get(service)
    is_this = service == services.this
    alive = is_this or services.is_alive(service)
    since = services.started if is_this else known.since if known else None
    return ServiceRow(
        service=service.service,
        robot=service.robot,
        status="up" if alive else "down",
        alive=alive,
        expected=expected,
        since=since,
        restarts=0 if known is None or is_this else known.restarts,
    )
