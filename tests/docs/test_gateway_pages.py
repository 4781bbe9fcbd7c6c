"""The pages on the gateway's protocols name every endpoint and topic there is, and none that is not."""

from __future__ import annotations

import re
from pathlib import Path

from tests.gateway.harness import new_app

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "chassis-api.md").read_text(encoding="utf-8")
MOTION = (DOCS / "motion.md").read_text(encoding="utf-8")


def test_every_endpoint_is_listed() -> None:
    document = new_app().openapi()
    real = {f"{method.upper()} {path}" for path, methods in document["paths"].items() for method in methods}
    listed = set(re.findall(r"^\| `((?:GET|POST|PATCH|PUT|DELETE) \S+)` \|", PAGE + MOTION, re.MULTILINE))
    assert listed == real
