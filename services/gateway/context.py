"""What every route works with: settings, state, and the one robot on the bus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Protocol, TypeVar, cast

from fastapi import Depends
from starlette.requests import HTTPConnection

from schemas.base import Message
from schemas.codec import MalformedMessage, codec_for
from schemas.topics import Query
from services.gateway.broadcast import Hub
from services.gateway.errors import BadRequest
from services.gateway.settings import Settings
from services.gateway.state import State

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

    async def ask(self, query: Query[Q, R], request: Q) -> R:
        """Ask the robot. Raises ``BadRequest`` for what the bus cannot carry (an integer over 64 bits, say)."""
        try:
            codec_for(query.request).dumps(request)
        except MalformedMessage as error:
            raise BadRequest(str(error)) from None
        return await self.bus.acall(query, request, self.settings.robot, timeout=self.settings.call_timeout)


def get_context(connection: HTTPConnection) -> Context:
    app: Any = connection.app
    return cast(Context, app.state.context)


Gateway = Annotated[Context, Depends(get_context)]
