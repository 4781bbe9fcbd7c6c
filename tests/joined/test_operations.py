"""Requests in any order, to the gateway of a joined world. ``python -m benchmarks operations`` makes 20,000 of them."""

from __future__ import annotations

from pathlib import Path

from hypothesis import HealthCheck, Phase, settings
from hypothesis.stateful import run_state_machine_as_test

from tests.joined.operations import Operations
from tests.joined.served import served_world

STEPS, RUNS = 75, 3  # the first run of hypothesis takes the simplest of all choices, again and again


def test_any_requests_in_any_order_are_answered_and_nothing_is_touched(tmp_path: Path) -> None:
    chosen = settings(
        max_examples=RUNS,
        stateful_step_count=STEPS,
        deadline=None,
        derandomize=True,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    Operations.asked.clear()
    with served_world("warehouse", tmp_path) as served:
        Operations.served = served
        run_state_machine_as_test(Operations, settings=chosen)
    assert Operations.asked.total() > 1.5 * STEPS and Operations.asked["201"] > 0 and Operations.asked["WebSocket"] > 0
