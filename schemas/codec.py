"""Messages to msgpack and back, with one error for everything malformed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from functools import cache
from typing import Any, Generic, TypeVar

import msgspec
from pydantic import ValidationError

from rackhand.schemas.base import Message

M = TypeVar("M", bound=Message)

MEDIA_TYPE = "application/msgpack"
_encoder = msgspec.msgpack.Encoder()
_decoder = msgspec.msgpack.Decoder()


class MalformedMessage(ValueError):
    """Bytes that are not the message they should be: truncated, wrong type, length or version, not finite.

    The text says what was expected and, where one is to blame, which field.
    """


class Codec(Generic[M]):
    """Encodes and decodes one message model.

    ``encoding`` names type, version and schema fingerprint: ``application/msgpack;chassis.Scan@1#0a1b2c3d4e5f``.
    """

    def __init__(self, model: type[M]) -> None:
        self.model = model
        self.name = f"{model.__module__.removeprefix('rackhand.schemas.')}.{model.__name__}"
        self.fingerprint = hashlib.sha256(_canonical(model.model_json_schema()).encode()).hexdigest()[:12]
        # What ``model_dump`` and ``model_validate`` call, without the 1 to 2 µs that their options cost a message.
        self._to_python: Callable[[M], Any] = model.__pydantic_serializer__.to_python
        self._validate: Callable[[Any], M] = model.__pydantic_validator__.validate_python
        self.encoding = f"{MEDIA_TYPE};{self.name}@{model.VERSION}#{self.fingerprint}"

    def dumps(self, message: M) -> bytes:
        """Raises ``MalformedMessage`` for free-form fields that msgpack cannot carry (an integer over 64 bits, say)."""
        try:
            return _encoder.encode(self._to_python(message))
        except (ValueError, TypeError, OverflowError, RecursionError) as error:
            raise MalformedMessage(f"{self.name}: cannot be encoded: {error}") from None

    def loads(self, payload: bytes, encoding: str | None = None) -> M:
        """Raises ``MalformedMessage``; ``encoding``, where the sender gave one, is checked first."""
        if encoding is not None and encoding != self.encoding:
            self._check_encoding(encoding)
        try:
            value = _decoder.decode(payload)
        except (ValueError, RecursionError, msgspec.MsgspecError) as error:
            raise MalformedMessage(f"{self.name}: {error} ({len(payload)} bytes, starts {payload[:8].hex()})") from None
        try:
            return self._validate(value)
        except ValidationError as error:
            raise MalformedMessage(f"{self.name}: {explain(error)}") from None
        except RecursionError:
            raise MalformedMessage(f"{self.name}: nested too deeply") from None

    def _check_encoding(self, encoding: str) -> None:
        """Plain msgpack, and any schema of the same type and version, may pass: validation has the last word."""
        media, _, schema = encoding.partition(";")
        if media != MEDIA_TYPE and encoding != "zenoh/bytes":
            raise MalformedMessage(f"{self.name}: encoded as {encoding[:80]!r}, want {MEDIA_TYPE}")
        name, _, version = schema.partition("#")[0].partition("@")
        if schema and name != self.name:
            raise MalformedMessage(f"{self.name}: the encoding names it {name[:80]!r}")
        if version and version != str(self.model.VERSION):
            raise MalformedMessage(
                f"{self.name}: the sender uses version {version[:20]}, this side version {self.model.VERSION}"
            )


def codec_for(model: type[M]) -> Codec[M]:
    """The one codec of a model: its schema is hashed once."""
    return _codec_for(model)


@cache
def _codec_for(model: Any) -> Codec[Any]:
    return Codec(model)


def explain(error: ValidationError, limit: int = 3) -> str:
    """A pydantic error in one line: ``field.path: what was wrong; …``."""
    found = error.errors(include_url=False, include_context=False, include_input=False)
    lines = [
        f"{'.'.join(str(part) for part in e['loc']) or 'message'}: {e['msg'].removeprefix('Value error, ')}"
        for e in found[:limit]
    ]
    return "; ".join(lines) + (f" (and {len(found) - limit} more)" if len(found) > limit else "")


def _canonical(schema: Any) -> str:
    """The schema without what does not change the wire: titles, descriptions and examples."""

    def strip(node: Any) -> Any:
        if isinstance(node, dict):
            dropped = ("title", "description", "examples")
            return {k: strip(v) for k, v in node.items() if not (k in dropped and isinstance(v, str | list))}
        return [strip(item) for item in node] if isinstance(node, list) else node

    return json.dumps(strip(schema), sort_keys=True)
