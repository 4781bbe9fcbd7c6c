"""``/robots/{name}/…``: the whole API of one robot of a fleet. Paths without it are those of the default robot."""

from __future__ import annotations

from collections.abc import Sequence

from fastapi import APIRouter, Request
from pydantic import BaseModel
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket

FOLDER = "/robots"
_KEY = "rackhand.robot"

router = APIRouter(tags=["device"])


class RobotRow(BaseModel):
    """A robot this gateway serves. ``path`` goes before the paths of its API; the default robot also has them
    without.
    """

    name: str
    path: str
    default: bool


@router.get(FOLDER)
async def list_robots(request: Request) -> list[RobotRow]:
    """The mobile robots this gateway serves."""
    fleet = request.app.state.shared.fleet
    return [RobotRow(name=name, path=f"{FOLDER}/{name}", default=name == fleet.default) for name in fleet.names]


class RobotPrefix:
    """Takes ``/robots/{name}`` off a path and remembers the robot; 404 for a robot that is not served here."""

    def __init__(self, app: ASGIApp, names: Sequence[str]) -> None:
        self.app = app
        self.names = tuple(names)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        path = scope.get("path", "")
        if not path.startswith(f"{FOLDER}/") or path == f"{FOLDER}/":
            await self.app(scope, receive, send)
            return
        name, _, rest = path.removeprefix(f"{FOLDER}/").partition("/")
        if name in self.names:
            await self.app({**scope, "path": f"/{rest}", _KEY: name}, receive, send)
            return
        answer = JSONResponse({"detail": self._unknown(name)}, status_code=404)
        if scope["type"] == "websocket":
            await WebSocket(scope, receive, send).send_denial_response(answer)
        else:
            await answer(scope, receive, send)

    def _unknown(self, name: str) -> str:
        return f"there is no robot {name[:60]!r} here; known: {', '.join(self.names) or 'none'}"


def robot_of(scope: Scope) -> str:
    """The robot that a request's path named; empty if it named none."""
    return str(scope.get(_KEY, ""))


def prefix_of(scope: Scope) -> str:
    """What was taken off a request's path: ``/robots/amr2``, or nothing."""
    return f"{FOLDER}/{scope[_KEY]}" if _KEY in scope else ""
