"""``/``: the page for browsers, a list of what there is for programs."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response

from rackhand.services.gateway.http.errors import not_found
from rackhand.services.gateway.http.pages import asset, page

router = APIRouter(include_in_schema=False)

_FOLDER = files("rackhand.services.gateway") / "page"
# What browsers may ask for, by name: nothing else of the disk is ever read.
ASSETS = frozenset(entry.name for entry in _FOLDER.iterdir() if entry.name.endswith((".js", ".css")))
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
    "jack": "/chassis/jack",
}
_SERVICES = (
    "/services/wheel_control/set_control_mode",
    "/services/wheel_control/set_emergency_stop",
    "/services/jack_up",
    "/services/jack_down",
    "/services/jack_self_check",
    "/services/clear_jack_errors",
    "/services/start_rack_size_detection",
    "/services/stop_rack_size_detection",
    "/services/query_pose/rack_pose",
    "/services/query_pose/charger_pose",
)


@router.get("/")
def index(request: Request) -> Response:
    if "text/html" in request.headers.get("accept", ""):
        return page((_FOLDER / "index.html").read_text("utf-8"))
    return JSONResponse(_INDEX)


@router.get("/page/{name}")
def page_asset(name: str) -> Response:
    if name not in ASSETS:
        raise not_found("Not Found")
    return asset(_FOLDER / name)


@router.get("/chassis")
async def chassis_index() -> dict[str, Any]:
    return _CHASSIS


@router.get("/services")
async def services_index() -> list[str]:
    return list(_SERVICES)
