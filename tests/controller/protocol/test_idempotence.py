"""Retries: what is recognised as one, and for how long."""

from __future__ import annotations

from typing import Any

import pytest

from tests.controller.protocol.bench import OK, PATH, Bench

LIFE = 5.0  # seconds, the default of ``AccessConfig.retry_ns``


def test_a_program_that_numbers_its_requests_may_be_run_again() -> None:
    bench = Bench()
    for run in range(1, 4):
        for number in (1, 2, 3):
            assert bench.ask("a", **PATH, id=number)["message"] == OK
        assert len(bench.queue) == 3 * run, "a second run of the same text seconds later drives again"
        bench.wait(LIFE)


@pytest.mark.parametrize(("after", "driven"), [(0.0, 1), (LIFE - 0.1, 1), (LIFE + 0.1, 2)])
def test_a_retry_is_a_matter_of_seconds(after: float, driven: int) -> None:
    bench = Bench()
    bench.ask("a", **PATH, id=3)
    bench.wait(after)
    assert bench.ask("a", **PATH, id=3)["message"] == OK
    assert len(bench.queue) == driven


def test_a_retry_does_not_prolong_the_memory() -> None:
    bench = Bench()
    for _ in range(4):
        bench.ask("a", **PATH, id=3)
        bench.wait(LIFE / 2)
    assert len(bench.queue) == 2


def test_the_time_of_a_retry_is_a_setting() -> None:
    for retry_ns, driven in ((0, 2), (60_000_000_000, 1)):
        bench = Bench(retry_ns=retry_ns)
        bench.ask("a", **PATH, id=3)
        bench.wait(9.0)
        bench.ask("a", **PATH, id=3)
        assert len(bench.queue) == driven
    with pytest.raises(ValueError, match="retries are recognised for -1 ns"):
        Bench(retry_ns=-1)


SETTINGS: list[dict[str, Any]] = [
    {"command": "setProfileVelocity", "type": "joints", "data": [0.5] * 6},
    {"command": "setProfileAcceleration", "type": "joints", "data": [0.5] * 6},
    {"command": "setParameters", "data": {"Controller": {}}},
    {"command": "setGripper", "suction": True},
    {"command": "startJointsControl"},
    {"command": "resumeControl"},
]


@pytest.mark.parametrize("request_", SETTINGS, ids=lambda request: request["command"])
def test_only_a_path_is_not_repeated_by_a_retry(request_: dict[str, Any]) -> None:
    """Between the two another client may have changed what the first has set."""
    bench = Bench()
    for _ in range(2):
        assert bench.ask("a", **request_, priority=10, id=1)["message"] == OK
        assert bench.turn.granted, "it is executed again"


def test_a_used_id_does_not_keep_a_stop_latched() -> None:
    bench = Bench()
    for _ in range(2):
        bench.ask("b", command="softStop")
        assert bench.ask("a", **PATH, id=1)["message"]["code"] == 403
        assert bench.ask("a", command="resumeControl", priority=10, id=2)["message"] == OK
        assert bench.dispatcher.access.stopped_by is None


def test_a_used_id_does_not_keep_control() -> None:
    bench = Bench()
    for _ in range(3):
        assert bench.ask("a", command="lockControl", priority=10, id=1)["message"] is True
        assert bench.ask("a", command="unlockControl", priority=10, id=2)["message"] is True
        assert bench.dispatcher.access.priority_under_control == 0
