"""``/ws/v2/topics`` and its legacy twin: clients enable topics, listen, and drive by remote control."""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from typing import Annotated, Any

from fastapi import APIRouter, WebSocket
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.websockets import WebSocketDisconnect

from rackhand.bus import BusError
from rackhand.schemas import topics
from rackhand.schemas.base import Twist2
from rackhand.schemas.chassis import ChassisRequest, RemoteTwist
from rackhand.schemas.codec import MalformedMessage, explain
from rackhand.services.gateway.chassis_api.device import device_info_brief
from rackhand.services.gateway.context import Context, Gateway
from rackhand.services.gateway.http.bodies import MalformedJson, read_json
from rackhand.services.gateway.ws.broadcast import Client, frame

router = APIRouter()

TopicName = Annotated[str, Field(min_length=1, max_length=200)]


class _Frame(BaseModel):
    model_config = ConfigDict(strict=True, extra="ignore", allow_inf_nan=False)


class Twist(_Frame):
    """One step of remote driving, m/s and rad/s, left positive."""

    linear_velocity: float
    angular_velocity: float


class Subscription(_Frame):
    enable_topic: TopicName | list[TopicName] = []
    disable_topic: TopicName | list[TopicName] = []


@router.websocket("/ws/v2/topics")
async def topics_v2(websocket: WebSocket, gateway: Gateway) -> None:
    await _serve(websocket, gateway, legacy=False)


@router.websocket("/ws/topics")
async def topics_v1(websocket: WebSocket, gateway: Gateway) -> None:
    await _serve(websocket, gateway, legacy=True)


async def _serve(websocket: WebSocket, gateway: Context, legacy: bool) -> None:
    await websocket.accept()
    client = gateway.hub.join(legacy)
    tasks = [asyncio.create_task(_send(websocket, client)), asyncio.create_task(_receive(websocket, gateway, client))]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        gateway.hub.leave(client)
        for task in tasks:
            task.cancel()
        ended = await asyncio.gather(*tasks, return_exceptions=True)
    for error in ended:
        if isinstance(error, Exception):
            raise error


async def _send(websocket: WebSocket, client: Client) -> None:
    with suppress(WebSocketDisconnect):
        while True:
            await websocket.send_text(await client.outbox.next())


async def _receive(websocket: WebSocket, gateway: Context, client: Client) -> None:
    while True:
        message = await websocket.receive()
        if message["type"] == "websocket.disconnect":
            return
        for reply in await answer(message, gateway, client):
            await client.outbox.reply(reply)


async def answer(message: Any, gateway: Context, client: Client) -> list[str]:
    """What one frame is answered with. A frame that is wrong changes nothing and is told so; the connection stays."""
    text = message.get("text")
    try:
        value = read_json(text if text is not None else message.get("bytes") or b"")
        if not isinstance(value, dict):
            raise MalformedJson("want a JSON object")
        if "enable_topic" in value or "disable_topic" in value:
            return [_subscribe(Subscription.model_validate(value), gateway, client)]
        match value.get("topic"):
            case "/twist":
                return [await _drive(Twist.model_validate(value), gateway)]
            case "/get_device_info_brief":
                return [frame("/device_info_brief", device_info_brief(gateway.state))]
            case None:
                raise MalformedJson("want enable_topic, disable_topic or topic")
            case other:
                raise MalformedJson(f"topic {str(other)[:80]!r} takes nothing from clients")
    except ValidationError as error:
        return [_error(explain(error))]
    except (MalformedJson, MalformedMessage, BusError, ValueError) as error:
        return [_error(str(error))]


def _subscribe(wanted: Subscription, gateway: Context, client: Client) -> str:
    """The complete set of enabled topics. Unknown ones are echoed, and stay silent: clients take the echo for truth."""
    for name in client.change(_listed(wanted.enable_topic), _listed(wanted.disable_topic)):
        gateway.hub.send_present(client, name)
    return json.dumps({"enabled_topics": client.enabled}, separators=(",", ":"))


def _listed(names: str | list[str]) -> list[str]:
    return [names] if isinstance(names, str) else names


async def _drive(twist: Twist, gateway: Context) -> str:
    """The feedback is the client's flow control: one for each command that was taken."""
    body = Twist2(linear=twist.linear_velocity, angular=twist.angular_velocity)
    await gateway.ask(topics.CHASSIS_REQUEST, ChassisRequest(request=RemoteTwist(twist=body)))
    return frame("/twist_feedback", {})


def _error(text: str) -> str:
    return frame("/error", {"detail": text})
