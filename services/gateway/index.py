"""``/``: the page for browsers, a list of what there is for programs."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, JSONResponse, Response

from services.gateway.errors import not_found

router = APIRouter(include_in_schema=False)

_PAGE = files("services.gateway") / "page"
_ASSETS = {
    "page.js": "text/javascript; charset=utf-8",
    "draw.js": "text/javascript; charset=utf-8",
    "page.css": "text/css; charset=utf-8",
}
_INDEX = {
    "chassis": "/chassis/",
    "maps": "/maps/",
    "device": "/device/info",
    "services": "/services/",
    "health": "/healthz",
    "websocket": "/ws/v2/topics",
    "docs": "/docs",
    "openapi": "/openapi.json",
}
_CHASSIS = {
    "moves": "/chassis/moves",
    "current-map": "/chassis/current-map",
    "pose": "/chassis/pose",
    "status": "/chassis/status",
}
_SERVICES = (
    "/services/wheel_control/set_control_mode",
    "/services/wheel_control/set_emergency_stop",
    "/services/jack_up",
    "/services/jack_down",
)


@router.get("/")
def index(request: Request) -> Response:
    if "text/html" in request.headers.get("accept", ""):
        return HTMLResponse((_PAGE / "index.html").read_text("utf-8"))
    return JSONResponse(_INDEX)


@router.get("/page/{name}")
def asset(name: str) -> Response:
    if name not in _ASSETS:
        raise not_found("Not Found")
    return Response((_PAGE / name).read_text("utf-8"), media_type=_ASSETS[name])


@router.get("/chassis")
async def chassis_index() -> dict[str, Any]:
    return _CHASSIS


@router.get("/services")
async def services_index() -> list[str]:
    return list(_SERVICES)
