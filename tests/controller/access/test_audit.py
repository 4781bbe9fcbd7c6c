"""The audit log's lines, and what keeps a flood of refusals out of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from rackhand.services.controller.access.audit import AuditLog, DenialLimiter
from rackhand.services.controller.access.types import AuditEntry

MS = 1_000_000
ENTRY = AuditEntry(5, "appendPath", "b", "bob", "visitor", 20, "e1", 3, '"x"', 403, "a holds priority 10")


def test_the_log_is_appended_line_by_line(tmp_path: Path) -> None:
    path = tmp_path / "logs" / "audit.jsonl"
    for _ in range(2):
        log = AuditLog(path, wall=lambda: 1_700_000_000.25)
        log.write([ENTRY])
        log.write([])
        log.close()
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert len(lines) == 2
    assert lines[0]["wall"] == "2023-11-14T22:13:20.250+00:00"
    assert (lines[0]["client"], lines[0]["lease_id"], lines[0]["code"]) == ("b", 3, 403)


def test_a_flood_of_refusals_is_one_line_a_second() -> None:
    limiter = DenialLimiter()
    flood = [replace(ENTRY, monotonic_ns=i * MS) for i in range(1500)]
    kept = limiter.filter(flood)
    assert [entry.monotonic_ns for entry in kept] == [0, 1000 * MS]
    assert kept[1].text.endswith("(999 like it before left out)")
    accepted = [replace(ENTRY, code=200)] * 3
    assert limiter.filter(accepted) == accepted
