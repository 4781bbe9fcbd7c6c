"""What every route works with: settings, the services of the cell, and the one robot that the request is about."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Annotated, Any, Protocol, TypeVar, cast

from fastapi import Depends
from starlette.requests import HTTPConnection

from rackhand.schemas.base import Message
from rackhand.schemas.codec import MalformedMessage, codec_for
from rackhand.schemas.topics import Query
from rackhand.services.gateway.crf.hub import MotionHub
from rackhand.services.gateway.fleet import Fleet
from rackhand.services.gateway.http.errors import BadRequest, not_found
from rackhand.services.gateway.http.robots import prefix_of, robot_of
from rackhand.services.gateway.presence import Services
from rackhand.services.gateway.settings import Settings
from rackhand.services.gateway.state import RobotState
from rackhand.services.gateway.ws.broadcast import Hub

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)
_HOST = re.compile(r"[A-Za-z0-9.\-_]+(:\d+)?|\[[0-9A-Fa-f:.]+\](:\d+)?")


class BusClient(Protocol):
    """The part of ``bus.Bus`` that routes need."""

    async def acall(self, query: Query[Q, R], request: Q, robot: str, timeout: float) -> R:
        """Ask and wait. Raises ``Refused``, ``Unavailable`` or ``CallTimeout``."""


@dataclass(frozen=True)
class Shared:
    """What all requests share."""

    settings: Settings
    fleet: Fleet
    bus: BusClient
    motion: MotionHub = field(default_factory=MotionHub)


@dataclass(frozen=True)
class Context:
    """One request's view: ``robot`` is the chassis its path names, or the default one. ``prefix`` is what its URL has
    before the API's own paths, as in ``/robots/amr2``.
    """

    shared: Shared
    robot: str
    prefix: str = ""

    @property
    def settings(self) -> Settings:
        return self.shared.settings

    @property
    def services(self) -> Services:
        return self.shared.fleet.services

    @property
    def motion(self) -> MotionHub:
        return self.shared.motion

    @property
    def hub(self) -> Hub:
        return self.shared.fleet.hubs[self.robot]

    @property
    def state(self) -> RobotState:
        return self.hub.state

    @property
    def chassis(self) -> str:
        """The robot's name. Raises ``HTTPException`` (404) where this gateway serves arms only."""
        if not self.robot:
            raise not_found("this gateway serves no chassis")
        return self.robot

    async def ask(self, query: Query[Q, R], request: Q, timeout: float | None = None) -> R:
        """Ask the robot, and wait ``timeout`` s or as long as the settings say. Raises ``BadRequest`` for what the bus
        cannot carry (an integer over 64 bits, say)."""
        robot = self.chassis
        try:
            codec_for(query.request).dumps(request)
        except MalformedMessage as error:
            raise BadRequest(str(error)) from None
        return await self.shared.bus.acall(query, request, robot, timeout=timeout or self.settings.call_timeout)

    async def ask_arm(self, query: Query[Q, R], request: Q, arm: str) -> R:
        """Ask an arm's controller. Raises ``Refused``, ``Unavailable`` or ``CallTimeout``."""
        return await self.shared.bus.acall(query, request, arm, timeout=self.settings.motion_timeout)


def get_context(connection: HTTPConnection) -> Context:
    app: Any = connection.app
    shared = cast(Shared, app.state.shared)
    return Context(shared, robot_of(connection.scope) or shared.fleet.default, prefix_of(connection.scope))


def root_of(request: HTTPConnection, context: Context) -> str:
    """``http://host:port`` as the client called it, with the path of the robot."""
    host = request.headers.get("host", "")
    return f"{request.scope['scheme']}://{host if _HOST.fullmatch(host) else 'localhost'}{context.prefix}"


Gateway = Annotated[Context, Depends(get_context)]
