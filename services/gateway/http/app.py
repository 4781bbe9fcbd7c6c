"""The HTTP and WebSocket application over a state and a bus."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute
from starlette.middleware.cors import CORSMiddleware

from rackhand.services.gateway.chassis_api import (
    absent,
    chassis,
    device,
    files,
    live_map,
    mappings,
    maps,
    moves,
    parameters,
    system_settings,
)
from rackhand.services.gateway.context import BusClient, Shared
from rackhand.services.gateway.crf import motion
from rackhand.services.gateway.crf.hub import MotionHub
from rackhand.services.gateway.fleet import Fleet
from rackhand.services.gateway.http import docs, errors, health, robots, world
from rackhand.services.gateway.http.methods import AllowedMethods
from rackhand.services.gateway.http.middleware import AnyMethod, SecretHeader, StrictBody, TrailingSlash
from rackhand.services.gateway.page import index
from rackhand.services.gateway.settings import Settings
from rackhand.services.gateway.ws import payloads, websocket

DESCRIPTION = """
The chassis API. Units are metres, radians and seconds; poses are in the current map.

Changes of state are published over WebSocket at `/ws/v2/topics`: send
`{"enable_topic": ["/planning_state", "/tracked_pose"]}`. Every path may end in a slash or not. Unknown keys of a body
are ignored, except by `/robot-params` and `/system/settings`. Where several robots are served, each has this API under
`/robots/{name}`; the paths without this prefix are those of the default robot.
"""

# In the order in which the documentation shows them.
TAGS = (
    "moves",
    "chassis",
    "services",
    "maps",
    "device",
    "settings",
    "motion",
    "world",
    "health",
    "not on this chassis",
)


def create_app(fleet: Fleet, bus: BusClient, settings: Settings | None = None) -> FastAPI:
    """The application. Messages of the bus go to ``fleet``, in the server's event loop.

    Raises ``LookupError`` where a WebSocket topic of the table of topics has no payload function.
    """
    settings = settings or Settings()
    payloads.check_complete()
    app = FastAPI(
        title="rackhand chassis API",
        description=DESCRIPTION,
        version="1",
        redirect_slashes=False,
        docs_url=None,  # it would load Swagger UI from elsewhere; docs.py does not
        redoc_url=None,
        strict_content_type=False,
        openapi_tags=[{"name": name} for name in TAGS],
        generate_unique_id_function=_operation_id,
    )
    app.state.shared = Shared(settings, fleet, bus, MotionHub(settings.arms))
    for router in (
        index.router,
        docs.router,
        absent.router,
        moves.router,
        chassis.router,
        chassis.services,
        parameters.router,
        system_settings.router,
        maps.router,
        live_map.router,
        mappings.router,
        device.router,
        files.router,
        absent.services,
        robots.router,
        motion.router,
        world.router,
    ):
        app.include_router(router)
    app.include_router(health.router)
    app.include_router(websocket.router)
    _describe(app)
    methods = AllowedMethods(app.openapi())
    errors.install(app, methods.header)
    # The last one added is the first to see a request.
    app.add_middleware(
        StrictBody,
        routes=app.routes,
        find=methods.find,
        max_bytes=settings.max_body_bytes,
        numbers=maps.NUMBERS,
    )
    app.add_middleware(AnyMethod, allowed=methods.header)
    app.add_middleware(SecretHeader, secret=settings.secret)
    app.add_middleware(TrailingSlash)
    app.add_middleware(robots.RobotPrefix, names=fleet.names)
    app.add_middleware(
        CORSMiddleware,
        allow_origin_regex=settings.allow_origins,
        allow_credentials=True,
        allow_methods=["GET", "HEAD", "OPTIONS", "POST", "PUT", "PATCH", "DELETE"],
        allow_headers=["*"],
    )
    return app


def _operation_id(route: APIRoute) -> str:
    return route.name


def _describe(app: FastAPI) -> None:
    """The OpenAPI document without the status 422, which this server never answers."""
    build = app.openapi

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = build()
            for path in document["paths"].values():
                for operation in path.values():
                    operation["responses"].pop("422", None)
            for name in ("HTTPValidationError", "ValidationError"):
                document["components"]["schemas"].pop(name, None)
        return build()

    app.openapi = openapi  # type: ignore[method-assign]
