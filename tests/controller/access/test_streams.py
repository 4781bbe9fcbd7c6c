"""References that are streamed: how long one is followed, and which samples are refused."""

from __future__ import annotations

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import FencingToken, RefusalDetail
from rackhand.services.controller.access.streams import StreamGuard, StreamSample

MS = 1_000_000


def token(lease: int) -> FencingToken:
    return FencingToken(epoch="e1", lease=lease)


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
        decision = guard.offer(stale, 90 * MS)
        assert (decision.ok, decision.code) == (False, CrfCode.PreconditionFailed)
        assert decision.detail is RefusalDetail.STALE_SAMPLE and why in decision.text
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
