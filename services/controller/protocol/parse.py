"""A CRF request from its bytes: a typed request, or the exact answer the protocol has for what is wrong with it.

Two layers of failure (spec motion-controller §1.3): what is malformed is answered here with an error; what is well
formed and cannot be done is answered with an ``expected`` (``checks``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import msgspec
from msgspec import Raw
from pydantic import ValidationError

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.codec import explain
from rackhand.schemas.crf import CrfCode
from rackhand.services.controller.protocol.answers import Answer, error, refused

MAX_POINTS = 2_000
MAX_TEXT_BYTES = 2 * 1024 * 1024
MAX_FIELDS_BYTES = 64 * 1024  # of all but the points of a path
NOT_JSON = "Not valid json format"
MAX_DEPTH = 32
MIN_FREQUENCY = 1e-6  # Hz
MIN_HEARTBEAT_S, MAX_HEARTBEAT_S = 0.001, 3600.0

_BY_COMMAND: dict[str, type[crf.Request]] = {word: model for model in crf.REQUESTS for word in crf.words(model)}
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
    fields = _decode(text, max_points)
    if isinstance(fields, Answer):
        return Parsed(fields, {})
    echo = {"id": fields["id"]} if "id" in fields else {}
    free = {"data": fields["data"]} if isinstance(fields.get("data"), dict) else {}
    if _deeper(echo, MAX_DEPTH) or _deeper(free, MAX_DEPTH):
        return Parsed(error(NOT_JSON, f"nested more than {MAX_DEPTH} deep"), {})
    return Parsed(_typed(fields, joints, max_points), echo)


def _decode(text: bytes | str, max_points: int) -> dict[str, Any] | Answer:
    """The flat fields. A nested ``message`` object, as the seed describes it, is an alias: the top level wins.

    Only a path's points may be long. Whatever else is, and more points than are taken, is not even turned into values:
    that would take longer than a control period.
    """
    if len(text) > MAX_TEXT_BYTES:
        return error(NOT_JSON, f"{len(text)} bytes, at most {MAX_TEXT_BYTES}")
    try:
        fields = msgspec.json.decode(text, type=dict[str, Raw])
    except (ValueError, RecursionError) as problem:
        return _no_object(text, problem)
    try:
        nested = _object(fields.pop("message", None))
        fields = {**nested, **fields}
        command = _value(fields.get("command", Raw(b"null")))
        points = fields.pop("data", None) if command == "appendPath" else None
        size = sum(len(key) + len(bytes(raw)) for key, raw in fields.items())
        if size > MAX_FIELDS_BYTES:
            return error(NOT_JSON, f"{size} bytes beside the points of a path, at most {MAX_FIELDS_BYTES}")
        values = {key: _value(raw) for key, raw in fields.items()}
        return values if points is None else {**values, "data": _points(points, max_points)}
    except (ValueError, RecursionError) as problem:
        return error(NOT_JSON, str(problem))


def _no_object(text: bytes | str, problem: Exception) -> Answer:
    """Of what is no object, whether it is JSON."""
    try:
        value = msgspec.json.decode(text, type=Any if len(text) < MAX_FIELDS_BYTES else Raw)
    except (ValueError, RecursionError) as wrong:
        return error(NOT_JSON, str(wrong))
    if isinstance(value, dict):
        return error(NOT_JSON, str(problem))
    return error("Cannot get command field from received json", str(problem))


def _object(raw: Raw | None) -> dict[str, Raw]:
    try:
        return msgspec.json.decode(raw, type=dict[str, Raw]) if raw is not None else {}
    except msgspec.ValidationError:
        return {}


def _points(raw: Raw, max_points: int) -> Any:
    """The points as values, or as raw as they came where they are too many."""
    try:
        points = msgspec.json.decode(raw, type=list[Raw])
    except msgspec.ValidationError:
        return None if len(bytes(raw)) > MAX_FIELDS_BYTES else _value(raw)
    return points if len(points) > max_points else _value(raw)


def _value(raw: Raw) -> Any:
    return msgspec.json.decode(raw)


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
        case crf.StartStreamStatus(frequency=frequency) if not MIN_FREQUENCY <= frequency < math.inf:
            return error("Frequency not valid", f"{frequency} Hz, want at least {MIN_FREQUENCY:g}")
        case crf.StartStreamStatus(mode=mode) if mode not in (1, 2):
            return error("Mode not valid", f"mode {mode}, want 1 (frequency) or 2 (differential)")
        case crf.StartHeartbeat(period=period) if not MIN_HEARTBEAT_S <= period <= MAX_HEARTBEAT_S:
            return error("Heartbeat period not valid", f"{period} s, want {MIN_HEARTBEAT_S:g} to {MAX_HEARTBEAT_S:g}")
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
