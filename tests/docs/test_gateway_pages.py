"""The pages on the gateway's protocols name every endpoint and topic there is, and none that is not."""

from __future__ import annotations

import re
from pathlib import Path

from tests.gateway.harness import new_app

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "chassis-api.md").read_text(encoding="utf-8")
COVERAGE = (DOCS / "api-coverage.md").read_text(encoding="utf-8")
HIDDEN = {"GET /chassis/moves/latest", "POST /services/wheel_control/set_emergency_stop_pressed"}  # for some clients
MOTION = (DOCS / "motion.md").read_text(encoding="utf-8")


def test_every_endpoint_is_listed() -> None:
    document = new_app().openapi()
    real = {f"{method.upper()} {path}" for path, methods in document["paths"].items() for method in methods}
    rows = re.compile(r"^\| `((?:GET|POST|PATCH|PUT|DELETE) \S+)` +\|", re.MULTILINE)
    assert set(rows.findall(PAGE + MOTION)) <= real
    listed = {_unnamed(row) for row in rows.findall(PAGE + MOTION + COVERAGE)}
    assert listed - HIDDEN == {_unnamed(row) for row in real}


def _unnamed(row: str) -> str:
    return re.sub(r"{\w+}", "{}", row)
