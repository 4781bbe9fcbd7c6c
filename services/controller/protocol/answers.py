"""Answers in CRF's three shapes: reply, error, event (spec motion-controller §1.3)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import msgspec

from rackhand.schemas.base import Message
from rackhand.schemas.motion import Expected
from rackhand.services.controller.access.types import SECOND, Decision

MAX_TEXT = 400


@dataclass(frozen=True)
class Answer:
    """``message`` is JSON-ready. ``extras``: fields that CRF does not have, at the top level where stock clients do
    not look."""

    name: str
    message: Any
    extras: dict[str, Any] = field(default_factory=dict)


def reply(command: str, message: Any, text: str = "", **extras: Any) -> Answer:
    """``message`` may be a model; ``text`` says why something was refused."""
    if text:
        extras["text"] = text[:MAX_TEXT]
    return Answer(command, message.model_dump(exclude_none=True) if isinstance(message, Message) else message, extras)


def error(message: str | int, text: str = "") -> Answer:
    """A string of the base layer, or a bare code of the device (400)."""
    return reply("error", message, text)


def refused(command: str, code: int, detail: int = 0, text: str = "") -> Answer:
    """Well formed, and refused."""
    return reply(command, Expected[bool].failed(code, detail), text)


def denied(command: str, decision: Decision) -> Answer:
    """What priority access refused."""
    return refused(command, decision.code, decision.detail, decision.text)


def lease_extras(decision: Decision) -> dict[str, Any]:
    """Fields about the grant, for clients that gave a name."""
    if decision.token is None:
        return {}
    token = decision.token
    return {"leaseId": token.lease, "epoch": token.epoch, "keepAlive": decision.keep_alive_ns / SECOND}


def event(name: str, info: Message) -> bytes:
    """An unsolicited event: a reply without ``id``."""
    return encode(reply(name, info))


def encode(answer: Answer, echo: dict[str, Any] | None = None) -> bytes:
    """UTF-8 JSON. ``echo``: ``{"id": …}`` of the request, or nothing. Doubles keep all their digits."""
    body = {"command": "reply", "replyCommand": answer.name, "message": answer.message, **(echo or {}), **answer.extras}
    return msgspec.json.encode(body)


def encode_id(echo: dict[str, Any]) -> bytes:
    """The request's ``id`` as JSON text; empty without one."""
    return msgspec.json.encode(echo["id"]) if echo else b""
