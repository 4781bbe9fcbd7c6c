"""The pages on the gateway's protocols name every endpoint and topic there is, and none that is not."""

from __future__ import annotations

import re
from pathlib import Path

from rackhand.bus import Bus
from rackhand.schemas.service import CELL, ServiceId
from rackhand.services.gateway.http.app import create_app
from rackhand.services.gateway.state import State
from rackhand.services.gateway.ws.topics import PAYLOADS

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "chassis-api.md").read_text(encoding="utf-8")
MOTION = (DOCS / "motion.md").read_text(encoding="utf-8")


def test_every_endpoint_is_listed() -> None:
    document = create_app(State("amr1"), Bus(ServiceId("gateway", CELL))).openapi()  # a bus that is never opened
    real = {f"{method.upper()} {path}" for path, methods in document["paths"].items() for method in methods}
    listed = set(re.findall(r"^\| `((?:GET|POST|PATCH|PUT|DELETE) \S+)` \|", PAGE + MOTION, re.MULTILINE))
    assert listed == real


def test_every_websocket_topic_is_listed() -> None:
    section = PAGE.partition("## WebSocket")[2].partition("Clients may send")[0]
    rows = [row for row in section.splitlines() if row.startswith("| `")]
    listed = {name for row in rows for name in re.findall(r"`(/[a-z0-9_/]+)`", row.split("|")[1])}
    assert listed == set(PAYLOADS)
