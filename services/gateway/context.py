"""What every route works with: settings, state, and the one robot on the bus."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, Protocol, TypeVar, cast

from fastapi import Depends
from starlette.requests import HTTPConnection

from rackhand.bus import Refused
from rackhand.schemas.base import Message
from rackhand.schemas.codec import MalformedMessage, codec_for
from rackhand.schemas.refusal import RefusalCode
from rackhand.schemas.topics import Query
from rackhand.services.gateway.crf.hub import MotionHub
from rackhand.services.gateway.http.errors import BadRequest
from rackhand.services.gateway.settings import Settings
from rackhand.services.gateway.state import State
from rackhand.services.gateway.ws.broadcast import Hub

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)


class BusClient(Protocol):
    """The part of ``bus.Bus`` that routes need."""

    async def acall(self, query: Query[Q, R], request: Q, robot: str, timeout: float) -> R:
        """Ask and wait. Raises ``Refused``, ``Unavailable`` or ``CallTimeout``."""


@dataclass(frozen=True)
class Context:
    settings: Settings
    state: State
    hub: Hub
    bus: BusClient
    motion: MotionHub = field(default_factory=MotionHub)

    @property
    def chassis(self) -> str:
        """The robot's name. Raises ``Refused`` (404) where this gateway serves arms only."""
        if not self.settings.robot:
            raise Refused(RefusalCode.NOT_FOUND, "this gateway serves no chassis")
        return self.settings.robot

    async def ask(self, query: Query[Q, R], request: Q) -> R:
        """Ask the robot. Raises ``BadRequest`` for what the bus cannot carry (an integer over 64 bits, say)."""
        try:
            codec_for(query.request).dumps(request)
        except MalformedMessage as error:
            raise BadRequest(str(error)) from None
        return await self.bus.acall(query, request, self.chassis, timeout=self.settings.call_timeout)

    async def ask_arm(self, query: Query[Q, R], request: Q, arm: str) -> R:
        """Ask an arm's controller. Raises ``Refused``, ``Unavailable`` or ``CallTimeout``."""
        return await self.bus.acall(query, request, arm, timeout=self.settings.motion_timeout)


def get_context(connection: HTTPConnection) -> Context:
    app: Any = connection.app
    return cast(Context, app.state.context)


Gateway = Annotated[Context, Depends(get_context)]
