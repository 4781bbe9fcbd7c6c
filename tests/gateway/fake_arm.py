"""A gateway of one arm whose controller echoes what it is asked."""

from __future__ import annotations

import asyncio
import json
from typing import Any

from rackhand.bus import BusError
from rackhand.schemas import topics
from rackhand.schemas.motion import CrfAnswer, CrfCall
from rackhand.services.gateway.context import Context
from tests.gateway.harness import Gateway


class FakeArm:
    """Echoes each call's text; ``held`` holds commands back, stops never."""

    def __init__(self) -> None:
        self.failure: BusError | None = None
        self.calls: list[tuple[str, str, str]] = []
        self.held: asyncio.Event | None = None

    async def acall(self, query: Any, request: CrfCall, robot: str, timeout: float) -> CrfAnswer:
        assert robot == "arm1" and timeout > 0
        if self.failure is not None:
            raise self.failure
        self.calls.append((query.name, request.session, request.text))
        if self.held is not None and query is topics.MOTION:
            await self.held.wait()
        return CrfAnswer(text=json.dumps({"command": "reply", "replyCommand": "echo", "message": request.text}))


ArmCell = tuple[Gateway, FakeArm, Context]
