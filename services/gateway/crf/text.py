"""CRF texts as the gateway reads them: only as far as it must to send them the right way. The controller judges."""

from __future__ import annotations

from typing import Any

import msgspec
from msgspec import UNSET, Raw

from rackhand.schemas.base import Message
from rackhand.schemas.crf import CrfCode

MAX_TEXT = 2 * 1024 * 1024  # bytes; the controller takes no more either
MAX_FRAME = 2 * MAX_TEXT  # a longer one ends its connection; up to here it is read, and answered that it is too long
NOT_JSON = "Not valid json format"
STOPS = frozenset({"softStop", "hardStop"})
_UNREADABLE = (ValueError, RecursionError, msgspec.MsgspecError)


class Envelope(msgspec.Struct):
    """What the gateway needs of a request; ``UNSET`` (an empty ``id``) where it is absent."""

    command: Any = UNSET
    client: Any = UNSET
    id: Raw = Raw(b"")
    message: Raw = Raw(b"")

    @property
    def is_stop(self) -> bool:
        return isinstance(self.command, str) and self.command in STOPS


def read_envelope(text: str) -> Envelope:
    """Never raises: of what is no request nothing is known. A nested ``message`` is an alias; the top level wins."""
    outer = _decode(text)
    if not bytes(outer.message):
        return outer
    inner = _decode(bytes(outer.message))
    for name in ("command", "client"):
        if getattr(outer, name) is UNSET:
            setattr(outer, name, getattr(inner, name))
    if not bytes(outer.id):
        outer.id = inner.id
    return outer


def to_text(raw: str | bytes) -> str | None:
    """The request's text; None where it is no UTF-8 or too long, which ``error_text(NOT_JSON, …)`` answers."""
    if len(raw) > MAX_TEXT:
        return None
    try:
        return raw if isinstance(raw, str) else raw.decode()
    except UnicodeDecodeError:
        return None


def unreadable(raw: str | bytes) -> str:
    """The protocol's answer to what ``to_text`` cannot read."""
    size = len(raw)
    return error_text(NOT_JSON, f"{size} bytes, at most {MAX_TEXT}" if size > MAX_TEXT else "it is not UTF-8")


def error_text(message: str | CrfCode, text: str, envelope: Envelope | None = None) -> str:
    """An error in CRF's form, with the request's ``id``; ``text`` (an extension) says why."""
    body: dict[str, Any] = {"command": "reply", "replyCommand": "error", "message": message}
    if envelope is not None and bytes(envelope.id):
        body["id"] = envelope.id
    return msgspec.json.encode(body | {"text": text}).decode()


def event_text(name: str, info: Message) -> str:
    """An unsolicited event in CRF's form."""
    message = info.model_dump(exclude_none=True)
    return msgspec.json.encode({"command": "reply", "replyCommand": name, "message": message}).decode()


def is_granted(answer: str, command: str) -> bool:
    """Whether this is the plain ``true`` that answers ``command``."""
    reply = _read(answer)
    return reply.get("replyCommand") == command and reply.get("message") is True


def message_of(answer: str) -> Any:
    """The ``message`` of a reply; None for an error."""
    reply = _read(answer)
    return None if reply.get("replyCommand") == "error" else reply.get("message")


def _decode(text: str | bytes) -> Envelope:
    try:
        return msgspec.json.decode(text, type=Envelope)
    except _UNREADABLE:
        return Envelope()


def _read(answer: str) -> dict[str, Any]:
    try:
        value = msgspec.json.decode(answer)
    except _UNREADABLE:
        return {}
    return value if isinstance(value, dict) else {}
