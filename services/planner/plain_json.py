"""Free-form fields that are kept and echoed as JSON: what only msgpack can encode is refused here."""

from __future__ import annotations

import json
from typing import Any


def json_error(value: Any) -> str | None:
    """Why a value would not come back from JSON as it went (bytes, NaN, integer keys, lone surrogates), or None."""
    try:
        text = json.dumps(value, allow_nan=False, ensure_ascii=False)
        text.encode()
        same = json.loads(text) == value
    except (TypeError, ValueError, RecursionError) as error:
        return f"not plain JSON: {error}"
    return None if same else "not plain JSON: keys must be strings"
