"""Causes of the reasons why moves fail: each has one, and each that a move can meet has a scenario."""

from __future__ import annotations

import pytest

from rackhand.schemas.fail_causes import CAUSES
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.worlds.scenario_model import installed_scenarios, read_scenario

PROVOKED = {read_scenario(path).expect.reason for path in installed_scenarios().values()}


def test_each_reason_has_a_cause() -> None:
    assert list(CAUSES) == list(Reason)


@pytest.mark.parametrize("reason", Reason, ids=lambda reason: reason.rest_name)
def test_a_reason_has_a_scenario_exactly_if_a_move_can_meet_it(reason: Reason) -> None:
    assert (reason in PROVOKED - {Reason.NONE}) == (CAUSES[reason].met == "move")
