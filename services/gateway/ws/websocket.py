"""``/ws/v2/topics`` and its legacy twin: clients enable topics, listen, and drive by remote control."""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from typing import Any

from fastapi import APIRouter, WebSocket
from pydantic import ValidationError
from starlette.websockets import WebSocketDisconnect

from rackhand.bus import BusError
from rackhand.schemas import topics
from rackhand.schemas.base import Twist2
from rackhand.schemas.chassis import ChassisRequest, FollowTarget, RemoteTwist
from rackhand.schemas.codec import MalformedMessage, explain
from rackhand.schemas.websocket import Empty, EnabledTopics, Error, FollowTargetState, Subscription, Twist
from rackhand.services.gateway.chassis_api.device import device_info_brief
from rackhand.services.gateway.context import Context, Gateway
from rackhand.services.gateway.http.bodies import MalformedJson, read_json
from rackhand.services.gateway.ws.broadcast import Client, frame

router = APIRouter()


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
    """The answers to one frame. A wrong one changes nothing and is answered on ``/error``; the connection stays."""
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
            case "/follow_target_state":
                await _follow(FollowTargetState.model_validate(value), gateway)
                return []
            case "/get_device_info_brief":
                return [json.dumps({"topic": "/device_info_brief", **device_info_brief(gateway.state)})]
            case None:
                raise MalformedJson("want enable_topic, disable_topic or topic")
            case other:
                raise MalformedJson(
                    f"topic {str(other)[:80]!r} cannot be published by clients; want /twist, /follow_target_state or "
                    "/get_device_info_brief"
                )
    except ValidationError as error:
        return [_error(explain(error))]
    except (MalformedJson, MalformedMessage, BusError, ValueError) as error:
        return [_error(str(error))]


def _subscribe(wanted: Subscription, gateway: Context, client: Client) -> str:
    """The complete set of enabled topics, unknown ones included, which stay silent: clients compare it with theirs."""
    for name in client.change(_listed(wanted.enable_topic), _listed(wanted.disable_topic)):
        gateway.hub.send_present(client, name)
    return EnabledTopics(enabled_topics=client.enabled).model_dump_json()


def _listed(names: str | list[str]) -> list[str]:
    return [names] if isinstance(names, str) else names


async def _drive(twist: Twist, gateway: Context) -> str:
    """The feedback is the client's flow control: one for each command that was taken."""
    body = Twist2(linear=twist.linear_velocity, angular=twist.angular_velocity)
    await gateway.ask(topics.CHASSIS_REQUEST, ChassisRequest(request=RemoteTwist(twist=body)))
    return frame("/twist_feedback", Empty())


async def _follow(state: FollowTargetState, gateway: Context) -> None:
    """Nothing is answered to a frame that was taken."""
    pose = state.target_pose if state.follow_state == "follow_pose" else None
    position = None if pose is None or pose.pos is None else (pose.pos[0], pose.pos[1])
    if state.follow_state == "follow_pose" and position is None and (pose is None or pose.ori is None):
        raise MalformedJson("target_pose: want pos, ori or both with follow_state 'follow_pose'")
    target = FollowTarget(state=state.follow_state, position=position, yaw=None if pose is None else pose.ori)
    await gateway.ask(topics.CHASSIS_REQUEST, ChassisRequest(request=target))


def _error(text: str) -> str:
    return frame("/error", Error(detail=text))
