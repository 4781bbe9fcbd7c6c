"""Endpoints of the chassis API whose device or data this kind of chassis does not have, made from the table of them."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse

from rackhand.schemas.api_coverage import ENDPOINTS, NOTHING_TO_CLEAR, Endpoint
from rackhand.services.gateway.chassis_api.models import Empty
from rackhand.services.gateway.context import Gateway
from rackhand.services.gateway.http.errors import detail, failures

router = APIRouter(tags=["not on this chassis"])
services = APIRouter(prefix="/services", tags=["services"])


@router.get("/hostnames")
async def hostnames() -> list[dict[str, str]]:
    """Local names of machines; there are none."""
    return []


@router.get("/bags")
async def bags() -> list[dict[str, str]]:
    """Recordings of the robot; there are none here, the viewer records: ``rackhand record FILE``."""
    return []


@router.get("/recording")
async def recordings() -> list[dict[str, str]]:
    """Recordings of the robot; there are none here, the viewer records: ``rackhand record FILE``."""
    return []


def _refusing(row: Endpoint) -> Callable[[Request], Awaitable[JSONResponse]]:
    async def refuse(_: Request) -> JSONResponse:
        return detail(row.status, row.text)

    refuse.__name__ = _name(f"no_{row.method}_{row.path}")
    return refuse


def _clearing(name: str) -> Callable[[Gateway], Awaitable[JSONResponse]]:
    async def clear(gateway: Gateway) -> JSONResponse:
        return JSONResponse({}, status_code=gateway.settings.service_status)

    clear.__name__ = _name(name)
    return clear


def _name(text: str) -> str:
    return re.sub(r"\W+", "_", text.lower()).strip("_")


def _parameters(path: str) -> list[dict[str, object]]:
    names = re.findall(r"{(\w+)}", path)
    return [{"name": name, "in": "path", "required": True, "schema": {"type": "string"}} for name in names]


for _row in ENDPOINTS:
    if not _row.works:
        # An id is text here: whatever it is, the answer is the same.
        router.add_api_route(
            _row.path,
            _refusing(_row),
            methods=[_row.method],
            responses=failures(_row.status),
            summary=f"Not on this chassis: {_row.text}",
            response_class=JSONResponse,
            openapi_extra={"parameters": found} if (found := _parameters(_row.path)) else None,
        )
for _service in NOTHING_TO_CLEAR:
    services.add_api_route(
        f"/{_service}",
        _clearing(_service),
        methods=["POST"],
        responses={200: {"description": "Done", "model": Empty}, 201: {"description": "Done, where so configured"}},
        summary="End an error that this chassis does not have: done at once",
    )
