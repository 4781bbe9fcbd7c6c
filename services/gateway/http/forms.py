"""``multipart/form-data`` (RFC 7578) as a JSON object, so that routes know one kind of body."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Collection
from email.message import Message

from rackhand.services.gateway.http.bodies import MalformedJson, read_json

_NUMBER = re.compile(r"-?\d+(\.\d+)?([eE][+-]?\d+)?")


class MalformedForm(ValueError):
    """The body is not the form that its Content-Type says; says what is wrong."""


def form_to_json(body: bytes, content_type: str, numbers: Collection[str]) -> bytes:
    """A JSON object with a string for each field of the form.

    Fields named in ``numbers`` become numbers, files become base64. Raises ``MalformedForm``.
    """
    fields: dict[str, object] = {}
    for name, value, is_file in _parts(body, _boundary(content_type)):
        if name in fields:
            raise MalformedForm(f"the field {name[:60]!r} is given twice")
        fields[name] = base64.b64encode(value).decode() if is_file else _text(name, value, numbers)
    return json.dumps(fields).encode()


def _text(name: str, value: bytes, numbers: Collection[str]) -> object:
    try:
        text = value.decode()
    except UnicodeDecodeError:
        raise MalformedForm(f"{name[:60]}: not UTF-8 text") from None
    if name not in numbers or not _NUMBER.fullmatch(text.strip()):
        return text  # whoever reads it says that it is no number
    try:
        return read_json(text.strip())
    except MalformedJson as error:
        raise MalformedForm(f"{name[:60]}: {error}") from None


def _boundary(content_type: str) -> bytes:
    header = Message()
    header["content-type"] = content_type
    boundary = header.get_param("boundary")
    if not isinstance(boundary, str) or not boundary:
        raise MalformedForm("Content-Type names no boundary")
    return b"--" + boundary.encode("latin-1", "replace")


def _parts(body: bytes, boundary: bytes) -> list[tuple[str, bytes, bool]]:
    """(name, content, is it a file) of each part."""
    _, *parts = (b"\r\n" + body).split(b"\r\n" + boundary)
    if not parts or not parts[-1].startswith(b"--"):
        raise MalformedForm("the body does not end with the boundary that Content-Type names")
    found = []
    for part in parts[:-1]:
        head, blank, content = part.partition(b"\r\n\r\n")
        name, is_file = _disposition(head.decode("utf-8", "replace"))
        if not blank or not name:
            raise MalformedForm("a part has no name")
        found.append((name, content, is_file))
    return found


def _disposition(head: str) -> tuple[str, bool]:
    """The name of a part, and whether it is a file."""
    header = Message()
    for line in head.split("\r\n"):
        key, _, value = line.partition(":")
        if key.strip().lower() == "content-disposition":
            header["content-disposition"] = value.strip()
    name = header.get_param("name", header="content-disposition")
    return (name if isinstance(name, str) else ""), header.get_filename() is not None
