"""JSON as clients send it, read strictly: one answer for every malformed text."""

from __future__ import annotations

import json
import math
import re
from typing import Any

from pydantic_core import from_json

_BARE_KEY = re.compile(rb"([{,]\s*)([A-Za-z_]\w*)(\s*:)")


class MalformedJson(ValueError):
    """The text is not JSON, or JSON that cannot be trusted; says what and where."""


def read_json(text: bytes | str) -> Any:
    """The value of a JSON text in UTF-8.

    Raises ``MalformedJson`` for anything else: other encodings, NaN and infinities (also ``1e999``), half characters,
    integers of thousands of digits, nesting deeper than 200, a key given twice.
    """
    try:
        from_json(text, allow_inf_nan=False, cache_strings="none")
        return json.loads(text, object_pairs_hook=_object, parse_float=_finite)
    except MalformedJson:
        raise
    except (ValueError, RecursionError) as error:
        raise MalformedJson(f"not valid JSON: {error}") from None


def quote_bare_keys(text: bytes) -> bytes:
    """``{state: "cancelled"}``, as the API's documentation writes it, made JSON. JSON stays as it is."""
    try:
        read_json(text)
    except MalformedJson:
        return _BARE_KEY.sub(rb'\1"\2"\3', text)
    return text


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    value = dict(pairs)
    if len(value) != len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise MalformedJson(f"the key {twice[:60]!r} is given twice")
    return value


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise MalformedJson(f"the number {text[:40]} is too large")
    return value
