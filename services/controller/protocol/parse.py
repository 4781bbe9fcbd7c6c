"""A CRF request from its bytes: a typed request, or the exact answer the protocol has for what is wrong with it.

Two layers of failure (spec motion-controller §1.3): what is malformed is answered here with an error; what is well
formed and cannot be done is answered with an ``expected`` (``checks``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import msgspec
from pydantic import ValidationError

from schemas import crf_requests as crf
from schemas.codec import explain
from schemas.crf import CrfCode
from services.controller.protocol.answers import Answer, error, refused

MAX_POINTS = 2_000
MAX_TEXT_BYTES = 2 * 1024 * 1024
MAX_DEPTH = 32
MAX_HEARTBEAT_S = 3600.0

_BY_COMMAND: dict[str, type[crf.Request]] = {
    word: model
    for model in crf.REQUESTS
    for word in model.model_fields["command"].annotation.__args__  # type: ignore[union-attr]
}
_PATHS: dict[Any, type[crf.Request]] = {"joints": crf.AppendJointsPath, "task": crf.AppendTaskPath}
# Of these a wrong field is answered in words, of the others with a bare 400.
_WORDED = (crf.LockControl, crf.UnlockControl, crf.StartStreamStatus, crf.StartHeartbeat)


@dataclass(frozen=True)
class Parsed:
    """A request or the answer to what is none; and its ``id`` to echo, as ``{"id": …}`` or ``{}``."""

    result: crf.Request | Answer
    echo: dict[str, Any]


def parse(text: bytes | str, joints: int, max_points: int = MAX_POINTS) -> Parsed:
    """Never raises. ``joints``: the arm's number; ``max_points``: the longest path that one request may bring."""
    fields = _decode(text)
    if isinstance(fields, Answer):
        return Parsed(fields, {})
    echo = {"id": fields["id"]} if "id" in fields else {}
    free = {"data": fields["data"]} if isinstance(fields.get("data"), dict) else {}
    if _deeper(echo, MAX_DEPTH) or _deeper(free, MAX_DEPTH):
        return Parsed(error("Not valid json format", f"nested more than {MAX_DEPTH} deep"), {})
    return Parsed(_typed(fields, joints, max_points), echo)


def _decode(text: bytes | str) -> dict[str, Any] | Answer:
    """The flat fields. A nested ``message`` object, as the seed describes it, is an alias: the top level wins."""
    if len(text) > MAX_TEXT_BYTES:
        return error("Not valid json format", f"{len(text)} bytes, at most {MAX_TEXT_BYTES}")
    try:
        value = msgspec.json.decode(text)
    except (ValueError, RecursionError) as problem:
        return error("Not valid json format", str(problem))
    if not isinstance(value, dict):
        return error("Cannot get command field from received json", f"{type(value).__name__}, want an object")
    nested = value.pop("message", None)
    return {**nested, **value} if isinstance(nested, dict) else value


def _typed(fields: dict[str, Any], joints: int, max_points: int) -> crf.Request | Answer:
    command = fields.get("command")
    if not isinstance(command, str):
        return error("Cannot get command field from received json")
    model = _BY_COMMAND.get(command)
    if model is None:
        return error(f"Unknown command: {command}")
    user = fields.get("user")
    if user is not None and not _is_user(user):
        return error(f"Unknown user fields: {command}", 'want {"name": string, "role": string}')
    if command == "appendPath":
        kind, data = fields.get("type"), fields.get("data")
        if not isinstance(kind, str) or kind not in _PATHS:
            return error(CrfCode.BadRequest, f'type {str(kind)[:40]!r}, want "joints" or "task"')
        if isinstance(data, list) and len(data) > max_points:
            return refused(command, CrfCode.ContentTooLarge, text=f"{len(data)} points, at most {max_points} at a time")
        model = _PATHS[kind]
    try:
        request = model.model_validate(fields, by_name=False, by_alias=True)
    except ValidationError as problem:
        return _malformed(model, problem)
    return _out_of_range(request, joints) or request


def _malformed(model: type[crf.Request], problem: ValidationError) -> Answer:
    text = explain(problem)
    if not issubclass(model, _WORDED):
        return error(CrfCode.BadRequest, text)
    found = problem.errors(include_url=False, include_context=False, include_input=False)
    range_only = all(e["loc"] == ("priority",) and e["type"] in _OUT_OF_RANGE for e in found)
    return error("Priority not valid" if range_only else "Wrong parameters", text)


_OUT_OF_RANGE = ("greater_than_equal", "less_than_equal")


def _out_of_range(request: crf.Request, joints: int) -> Answer | None:
    """What CRF's parser refuses by value."""
    match request:
        case crf.StartStreamStatus(frequency=frequency) if not (math.isfinite(frequency) and frequency > 0):
            return error("Frequency not valid", f"{frequency} Hz, want more than 0")
        case crf.StartStreamStatus(mode=mode) if mode not in (1, 2):
            return error("Mode not valid", f"mode {mode}, want 1 (frequency) or 2 (differential)")
        case crf.StartHeartbeat(period=period) if not 0 < period <= MAX_HEARTBEAT_S:
            return error("Heartbeat period not valid", f"{period} s, want more than 0, at most {MAX_HEARTBEAT_S:g}")
        case crf.LockControl(keep_alive=float(seconds)) if not (math.isfinite(seconds) and seconds > 0):
            return error("Wrong parameters", f"keepAlive {seconds} s, want more than 0")
        case crf.SetVelocity() | crf.SetTorque() if request.type == "joints" and len(request.data) != joints:
            return error(CrfCode.BadRequest, f"data has {len(request.data)} numbers, the arm {joints} joints")
    return None


def _is_user(user: Any) -> bool:
    return isinstance(user, dict) and isinstance(user.get("name"), str) and isinstance(user.get("role"), str)


def _deeper(value: Any, limit: int) -> bool:
    """Whether ``value`` is nested deeper than ``limit``: echoing or hashing it would exhaust the stack."""
    level = [value]
    for _ in range(limit):
        level = [
            inner
            for item in level
            for inner in (item if isinstance(item, list) else item.values() if isinstance(item, dict) else ())
            if isinstance(inner, list | dict)
        ]
        if not level:
            return False
    return True
