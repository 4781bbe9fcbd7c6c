"""Last hop, deadman and audit log."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import FencingToken, RefusalDetail
from rackhand.services.controller.access.audit import AuditLog, DenialLimiter
from rackhand.services.controller.access.hop import FencingGuard
from rackhand.services.controller.access.streams import StreamGuard, StreamSample
from rackhand.services.controller.access.types import AuditEntry

MS = 1_000_000


def token(lease: int, epoch: str = "e1") -> FencingToken:
    return FencingToken(epoch=epoch, lease=lease)


def test_older_leases_and_older_stamps_do_not_pass() -> None:
    hop = FencingGuard()
    assert hop.admit(token(3), 100)
    assert hop.admit(token(3), 100), "the same instant may be answered again"
    assert not hop.admit(token(3), 99)
    assert hop.admit(token(5), 50), "stamps start anew with a lease"
    assert not hop.admit(token(3), 200) and not hop.admit(token(4), 200)
    assert hop.newest == token(5)


def test_a_grant_shuts_out_the_old_lease_before_its_first_command() -> None:
    hop = FencingGuard()
    hop.admit(token(3), 100)
    assert hop.raise_to(token(4))
    assert not hop.admit(token(3), 101)


def test_an_epoch_does_not_come_back() -> None:
    hop = FencingGuard()
    hop.admit(token(9, "e1"), 100)
    assert hop.admit(token(0, "e2"), 0)
    assert not hop.admit(token(99, "e1"), 200)
    assert hop.newest == token(0, "e2")


def test_a_reference_dies_100_ms_after_its_last_refresh() -> None:
    guard = StreamGuard()
    assert guard.offer(StreamSample(token(1)), 0).ok
    assert guard.offer(StreamSample(token(1)), 60 * MS).ok
    assert not guard.expired(160 * MS - 1)
    assert guard.expired(160 * MS) and not guard.alive
    assert not guard.expired(161 * MS), "it dies once"


def test_a_sample_may_ask_for_less_time_but_not_for_more() -> None:
    guard = StreamGuard()
    guard.offer(StreamSample(token(1), timeout_ns=20 * MS), 0)
    assert guard.expired(20 * MS)
    guard.offer(StreamSample(token(1), timeout_ns=5000 * MS), 0)
    assert guard.expired(100 * MS)


def test_late_and_replayed_samples_are_refused_and_refresh_nothing() -> None:
    guard = StreamGuard()
    assert guard.offer(StreamSample(token(1), sequence=5, stamp=40 * MS), 50 * MS).ok
    for stale, why in (
        (StreamSample(token(1), sequence=5), "sequence 5 after 5"),
        (StreamSample(token(1), sequence=4), "sequence 4 after 5"),
        (StreamSample(token(1), sequence=6, stamp=39 * MS), "after 40000000"),
        (StreamSample(token(1), sequence=6, stamp=400 * MS), "ms old"),
    ):
        verdict = guard.offer(stale, 90 * MS)
        assert (verdict.ok, verdict.code) == (False, CrfCode.PreconditionFailed)
        assert verdict.detail is RefusalDetail.STALE_SAMPLE and why in verdict.text
    assert guard.expired(150 * MS)
    assert not guard.offer(StreamSample(token(1), sequence=6, stamp=45 * MS), 150 * MS).ok, "105 ms old"
    assert guard.offer(StreamSample(token(2), sequence=0), 150 * MS).ok, "a new lease counts anew"


def test_a_stop_is_a_barrier_for_samples_from_before_it() -> None:
    guard = StreamGuard()
    guard.offer(StreamSample(token(1), sequence=1, stamp=0), 10 * MS)
    guard.stop(20 * MS)
    assert not guard.alive
    assert "before the stop" in guard.offer(StreamSample(token(1), sequence=2, stamp=15 * MS), 25 * MS).text
    assert not guard.alive
    assert guard.offer(StreamSample(token(1), sequence=2, stamp=21 * MS), 25 * MS).ok


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
