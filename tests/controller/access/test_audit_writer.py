from __future__ import annotations

import json
from pathlib import Path

from rackhand.services.controller.access.audit import AuditLog
from rackhand.services.controller.access.audit_writer import AuditWriter
from rackhand.services.controller.access.types import AuditEntry


def entry(action: str, code: int = 200, at: int = 0) -> AuditEntry:
    return AuditEntry(at, action, "a", "ann", "operator", 10, "e1", 1, "7", code, "")


def test_everything_is_on_disk_when_it_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "arm1" / "audit.jsonl"
    failures: list[OSError] = []
    writer = AuditWriter(AuditLog(path), failures.append)
    for i in range(100):
        writer.put([entry(f"grant {i}")])
    writer.put([entry("appendPath", 403)] * 1000)
    writer.close()
    actions = [json.loads(line)["action"] for line in path.read_text().splitlines()]
    assert actions == [*(f"grant {i}" for i in range(100)), "appendPath"]
    assert failures == []


def test_a_disk_that_fails_ends_nothing(tmp_path: Path) -> None:
    class Failing(AuditLog):
        def write(self, entries: object) -> None:
            raise OSError(f"no space left for {entries}")

    failures: list[OSError] = []
    writer = AuditWriter(Failing(tmp_path / "audit.jsonl"), failures.append)
    writer.put([entry("grant")])
    writer.put([entry("expire")])
    writer.close()
    assert len(failures) == 2
