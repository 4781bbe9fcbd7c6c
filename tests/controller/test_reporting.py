"""When a status is made: after the command is there, and before anything else changes."""

from __future__ import annotations

import json

from rackhand.services.controller.reporting import STATUS_PERIOD_NS
from tests.controller.cell import PERIOD_NS, PerfectArm


def at_a_due_tick() -> PerfectArm:
    """Before the tick with which a status is due."""
    cell = PerfectArm()
    cell.advance(0.1)
    cell.stamp = (cell.stamp // STATUS_PERIOD_NS + 1) * STATUS_PERIOD_NS
    cell.status = None
    return cell


def test_the_command_does_not_wait_for_the_status() -> None:
    cell = at_a_due_tick()
    made: list[int] = []
    complete = cell.controller._arm.complete_status
    cell.controller._arm.complete_status = lambda status, now: made.append(now) or complete(status, now)  # type: ignore[func-returns-value]
    cell.controller.tick(cell.measured(), lockstep=True)
    assert not made
    cell.take()
    assert made == [cell.stamp] and cell.status is not None and cell.status.stamp == cell.stamp
    cell.controller.poll()
    cell.take()
    assert made == [cell.stamp], "once"


def test_a_request_after_the_tick_is_not_in_its_status() -> None:
    """Or a run in lockstep would depend on how soon a request is read after the tick."""
    cell = at_a_due_tick()
    cell.controller.tick(cell.measured(), lockstep=True)
    cell.controller.request("a", json.dumps({"command": "lockControl", "priority": 10}), 1)
    cell.take()
    assert cell.status is not None and cell.status.priority_under_control == 0
    cell.stamp += STATUS_PERIOD_NS
    cell.tick()
    assert cell.status.priority_under_control == 10


def test_accelerations_are_differences_of_the_last_two_states() -> None:
    cell = PerfectArm()
    cell.ok("a", command="appendPath", type="joints", data=[(cell.arm.home + 0.5).tolist()])
    cell.advance(0.08)
    status = cell.get_status()
    (_, _, before), (_, _, now) = cell.history[-2:]
    expected = ((now - before) / (PERIOD_NS * 1e-9)).tolist()
    assert max(map(abs, expected)) > 0.5
    assert all(abs(a - b) < 1e-9 for a, b in zip(status["jointAccelerations"]["value"], expected, strict=True))
