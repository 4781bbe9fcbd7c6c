"""``/motion/{arm}``: the CRF protocol over HTTP, one request a POST, and over WebSocket, with events and streams."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request, Response, WebSocket
from fastapi.responses import JSONResponse
from starlette.websockets import WebSocketDisconnect

from rackhand.schemas import crf_examples, topics
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import CrfAnswer, CrfCall
from rackhand.services.gateway.context import Context, Gateway
from rackhand.services.gateway.crf.session import MotionQuery
from rackhand.services.gateway.crf.text import error_text, is_granted, message_of, read_envelope, to_text, unreadable
from rackhand.services.gateway.http.errors import failures, not_found, unavailable

router = APIRouter(prefix="/motion", tags=["motion"])

GET_STATUS = '{"command":"getStatus"}'
STOP_STREAM = '{"command":"stopStreamStatus"}'
_BODY = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {
                "schema": {"type": "object", "properties": {"command": {"type": "string"}}, "required": ["command"]},
                "examples": {name: {"value": value} for name, value in crf_examples.REQUESTS.items()},
            }
        },
    }
}
_ANSWERED: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The protocol's answer, refusals and errors included",
        "content": {
            "application/json": {
                "schema": {"type": "object"},
                "examples": {name: {"value": value} for name, value in crf_examples.ANSWERS.items()},
            }
        },
    }
}
Client = Annotated[str | None, Header(alias="X-Client", max_length=128, description="who asks; else its address is")]


@router.post("/{arm}/command", response_class=JSONResponse, responses={**_ANSWERED, **failures(400, 404, 413, 503)},
             openapi_extra=_BODY)  # fmt: skip
async def command(arm: str, request: Request, gateway: Gateway, x_client: Client = None) -> Response:
    """One CRF request as it is; its CRF reply as it is.

    The WebSocket `/motion/{arm}/ws` takes the same texts, one a frame, and answers each with one frame. There a
    connection is the client, and it also hears the events that concern it and the status stream it started, which
    HTTP cannot carry. Answers come as they are ready: give requests an `id`. Stops wait for nothing.
    """
    raw = await request.body()
    _known(gateway, arm)
    text = to_text(raw)
    if text is None:
        return _json(unreadable(raw))
    session = _session(gateway, request, x_client)
    envelope = read_envelope(text)
    answer = await _call(gateway, arm, topics.MOTION_STOP if envelope.is_stop else topics.MOTION, session, text)
    if is_granted(answer, "startStreamStatus"):
        await _call(gateway, arm, topics.MOTION, session, STOP_STREAM)
        return _json(error_text(CrfCode.MethodNotAllowed, "HTTP carries no stream; use /motion/{arm}/ws", envelope))
    return _json(answer)


@router.get("/{arm}/status", responses=failures(400, 404, 503))
async def status(arm: str, request: Request, gateway: Gateway, x_client: Client = None) -> dict[str, Any]:
    """What ``getStatus`` answers, without its envelope."""
    _known(gateway, arm)
    answer = await _call(gateway, arm, topics.MOTION, _session(gateway, request, x_client), GET_STATUS)
    found = message_of(answer)
    if not isinstance(found, dict):
        raise unavailable(f"the controller of {arm} returned no status: {answer[:200]}")
    return found


@router.websocket("/{arm}/ws")
async def motion_socket(websocket: WebSocket, arm: str, gateway: Gateway) -> None:
    if arm not in gateway.motion.arms:
        await websocket.send_denial_response(JSONResponse({"detail": _unknown(gateway, arm)}, status_code=404))
        return
    await websocket.accept()

    async def ask(query: MotionQuery, call: CrfCall) -> CrfAnswer:
        return await gateway.ask_arm(query, call, arm)

    async with gateway.motion.session(arm, ask) as session:

        async def receiving() -> None:
            while True:
                message = await websocket.receive()
                if message["type"] == "websocket.disconnect":
                    return
                text = message.get("text")
                session.take(text if text is not None else message.get("bytes") or b"")
                await asyncio.sleep(0)  # a flood leaves others their turn

        async def send(text: str) -> None:
            try:
                await websocket.send_text(text)
            except WebSocketDisconnect as error:
                raise ConnectionResetError from error

        await session.serve(receiving(), send)


async def _call(gateway: Context, arm: str, query: MotionQuery, session: str, text: str) -> str:
    return (await gateway.ask_arm(query, CrfCall(session=session, text=text), arm)).text


def _session(gateway: Context, request: Request, x_client: str | None) -> str:
    address = request.client.host if request.client else ""
    return gateway.motion.http_session(f"name {x_client}" if x_client else f"address {address}")


def _known(gateway: Context, arm: str) -> None:
    if arm not in gateway.motion.arms:
        raise not_found(_unknown(gateway, arm))


def _unknown(gateway: Context, arm: str) -> str:
    known = ", ".join(gateway.motion.arms) or "none"
    return f"there is no arm {arm[:60]!r} here; known: {known}"


def _json(text: str) -> Response:
    return Response(text, media_type="application/json")
