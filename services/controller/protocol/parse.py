"""A CRF request from its bytes: a typed request, or the exact answer the protocol has for what is wrong with it.

Two layers of failure (spec motion-controller §1.3): what is malformed is answered here with an error; what is well
formed and cannot be done is answered with an ``expected`` (the ``check`` of its ``CommandSpec``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import msgspec
from msgspec import Raw
from pydantic import ValidationError

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.codec import explain
from rackhand.schemas.crf import CrfCode
from rackhand.services.controller.commands.spec import CommandSpec, CommandTable
from rackhand.services.controller.protocol.answers import Answer, error, refused

MAX_POINTS = 2_000
MAX_TEXT_BYTES = 2 * 1024 * 1024
MAX_FIELDS_BYTES = 64 * 1024  # of all but the points of a path
NOT_JSON = "Not valid json format"
MAX_DEPTH = 32
_PATH = "appendPath"


@dataclass(frozen=True)
class Parsed:
    """A request, or the error for a text that is none; and its ``id`` to echo, as ``{"id": …}`` or ``{}``."""

    result: crf.Request | Answer
    echo: dict[str, Any]


def parse(text: bytes | str, joints: int, commands: CommandTable, max_points: int = MAX_POINTS) -> Parsed:
    """Never raises. ``joints``: number of the arm's joints; ``max_points``: the longest path of one request."""
    fields = _decode(text, max_points)
    if isinstance(fields, Answer):
        return Parsed(fields, {})
    echo = {"id": fields["id"]} if "id" in fields else {}
    free = {"data": fields["data"]} if isinstance(fields.get("data"), dict) else {}
    if _deeper(echo, MAX_DEPTH) or _deeper(free, MAX_DEPTH):
        return Parsed(error(NOT_JSON, f"nested more than {MAX_DEPTH} deep"), {})
    return Parsed(_typed(fields, joints, commands, max_points), echo)


def _decode(text: bytes | str, max_points: int) -> dict[str, Any] | Answer:
    """The flat fields. A nested ``message`` object, as the seed describes it, is an alias: the top level wins.

    Only a path's points may be long. Other long fields, and more points than are accepted, stay undecoded: decoding
    them would take longer than a control period.
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
        points = fields.pop("data", None) if command == _PATH else None
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


def _typed(fields: dict[str, Any], joints: int, commands: CommandTable, max_points: int) -> crf.Request | Answer:
    command = fields.get("command")
    if not isinstance(command, str):
        return error("Cannot get command field from received json")
    variants = commands.named(command)
    if not variants:
        return error(f"Unknown command: {command}")
    user = fields.get("user")
    if user is not None and not _is_user(user):
        return error(f"Unknown user fields: {command}", 'want {"name": string, "role": string}')
    spec = _variant(variants, fields.get("type"))
    if isinstance(spec, Answer):
        return spec
    data = fields.get("data")
    if command == _PATH and isinstance(data, list) and len(data) > max_points:
        return refused(command, CrfCode.ContentTooLarge, text=f"{len(data)} points, at most {max_points} at a time")
    try:
        request = spec.model.model_validate(fields, by_name=False, by_alias=True)
    except ValidationError as problem:
        return _malformed(spec, problem)
    wrong: Answer | None = spec.malformed(request, joints)
    return wrong or request


def _variant(variants: tuple[CommandSpec[Any], ...], kind: Any) -> CommandSpec[Any] | Answer:
    """The row that ``type`` chooses, where a command has several."""
    if len(variants) == 1:
        return variants[0]
    for spec in variants:
        if isinstance(kind, str) and crf.type_of(spec.model) == kind:
            return spec
    wanted = " or ".join(f'"{crf.type_of(spec.model)}"' for spec in variants)
    return error(CrfCode.BadRequest, f"type {str(kind)[:40]!r}, want {wanted}")


def _malformed(spec: CommandSpec[Any], problem: ValidationError) -> Answer:
    text = explain(problem)
    if not spec.named_errors:
        return error(CrfCode.BadRequest, text)
    found = problem.errors(include_url=False, include_context=False, include_input=False)
    range_only = all(e["loc"] == ("priority",) and e["type"] in _OUT_OF_RANGE for e in found)
    return error("Priority not valid" if range_only else "Wrong parameters", text)


_OUT_OF_RANGE = ("greater_than_equal", "less_than_equal")


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
