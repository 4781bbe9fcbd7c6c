"""The HTTP and WebSocket application over a state and a bus."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute
from starlette.middleware.cors import CORSMiddleware

from rackhand.services.gateway.chassis_api import chassis, device, maps, moves
from rackhand.services.gateway.context import BusClient, Context
from rackhand.services.gateway.crf import motion
from rackhand.services.gateway.crf.hub import MotionHub
from rackhand.services.gateway.http import docs, errors, health
from rackhand.services.gateway.http.methods import AllowedMethods
from rackhand.services.gateway.http.middleware import AnyMethod, SecretHeader, StrictBody, TrailingSlash
from rackhand.services.gateway.page import index
from rackhand.services.gateway.settings import Settings
from rackhand.services.gateway.state import State
from rackhand.services.gateway.ws import websocket
from rackhand.services.gateway.ws.broadcast import Hub

DESCRIPTION = """
The chassis API of one robot. Units are metres, radians and seconds; poses are in the current map.

What changes is told over WebSocket at `/ws/v2/topics`: send `{"enable_topic": ["/planning_state", "/tracked_pose"]}`.
Every path may end in a slash or not. Unknown keys of a body are ignored.
"""


def create_app(state: State, bus: BusClient, settings: Settings | None = None) -> FastAPI:
    """The application. Whoever feeds it events hands them to ``app.state.context.hub.hear``, in the server's loop."""
    settings = settings or Settings()
    app = FastAPI(
        title="rackhand chassis API",
        description=DESCRIPTION,
        version="1",
        redirect_slashes=False,
        docs_url=None,  # it would load Swagger UI from elsewhere; docs.py does not
        redoc_url=None,
        strict_content_type=False,
        generate_unique_id_function=_operation_id,
    )
    app.state.context = Context(settings, state, Hub(state, settings.interval), bus, MotionHub(settings.arms))
    for router in (
        index.router,
        docs.router,
        moves.router,
        chassis.router,
        chassis.services,
        maps.router,
        device.router,
        motion.router,
    ):
        app.include_router(router)
    app.include_router(health.router)
    app.include_router(websocket.router)
    _describe(app)
    allowed = AllowedMethods(app.openapi()).header
    errors.install(app, allowed)
    # The last one added is the first to see a request.
    app.add_middleware(StrictBody, max_bytes=settings.max_body_bytes)
    app.add_middleware(AnyMethod, allowed=allowed)
    app.add_middleware(SecretHeader, secret=settings.secret)
    app.add_middleware(TrailingSlash)
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
