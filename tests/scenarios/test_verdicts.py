"""Verdicts: each way in which a run can differ from what its scenario expects is one problem."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from rackhand.scenarios.verdicts import Outcome, Verdict, judge, table
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.worlds.scenario_model import Expectation, Explained, NamedThing

EXPECT = Expectation(state="failed", reason=Reason.RACK_DETECTION_ERROR, text=("no legs",), within=20.0)
MOVE: dict[str, Any] = {
    "id": 7,
    "state": "failed",
    "fail_reason": 501,
    "fail_reason_str": "rack_detection_error - 未识别到货架",
    "fail_message": "failed to find rack: no legs; at 's8'",
}
FRAME: dict[str, Any] = {
    "action_id": 7,
    "move_state": "failed",
    "fail_reason": 501,
    "fail_reason_str": "MoveFailReason::rack_detection_error",
}
GOOD = Outcome(MOVE, FRAME, 12.0)


def test_what_is_as_expected_has_no_problem() -> None:
    assert judge(EXPECT, GOOD) == ()


@pytest.mark.parametrize(
    ("outcome", "text"),
    [
        (replace(GOOD, took=None), "still failed; expected failed within 20 s"),
        (replace(GOOD, took=21.0), "ended after 21.0 s; expected at most 20 s"),
        (replace(GOOD, move=MOVE | {"fail_reason": 502}), "expected failed with 501 rack_detection_error"),
        (replace(GOOD, move=MOVE | {"state": "succeeded", "fail_reason": 0}), "the move succeeded with 0"),
        (replace(GOOD, move=MOVE | {"fail_reason_str": "rack_detection_error"}), "fail_reason_str of REST"),
        (replace(GOOD, move=MOVE | {"fail_message": "3 of 4 legs"}), "expected 'no legs' in it"),
        (replace(GOOD, frame=FRAME | {"action_id": 6}), "/planning_state shows (6,"),
        (replace(GOOD, frame=FRAME | {"fail_reason_str": "none"}), "/planning_state shows (7,"),
        (replace(GOOD, contacts=("crate", "crate")), "2 contacts, with crate; expected at most 0"),
    ],
)
def test_each_difference_is_a_problem(outcome: Outcome, text: str) -> None:
    (problem,) = judge(EXPECT, outcome)
    assert text in problem


def test_a_success_is_expected_without_a_reason() -> None:
    move = MOVE | {"state": "succeeded", "fail_reason": 0, "fail_reason_str": "None - None", "fail_message": ""}
    frame = FRAME | {"move_state": "succeeded", "fail_reason": 0, "fail_reason_str": "none"}
    assert judge(Expectation(state="succeeded", within=20.0), Outcome(move, frame, 3.0)) == ()


def test_the_table_has_a_row_for_each_and_the_problems_below() -> None:
    passed = Verdict("a", "empty", 1, "failed", 501, "no legs", 12.0, 0, 20.0, 3.0)
    failed = replace(passed, scenario="longer", took=None, problems=("it is still moving",))
    lines = table([passed, failed]).splitlines()
    assert len(lines) == 4
    assert lines[1].split()[:6] == ["a", "passed", "failed", "501", "rack_detection_error", "12.0"]
    assert "FAILED" in lines[2] and lines[3] == "longer: it is still moving"
    assert passed.as_json()["passed"] and not failed.as_json()["passed"]


LEG = {"kind": "rack leg", "role": "expected", "name": "", "pos": [1.0, 2.0], "clearance": None, "needed": None}
WALL = {"kind": "virtual wall", "role": "blocks", "name": "north", "pos": [3.0, 0.0], "clearance": -0.1, "needed": 0.05}
SEEN = {"name": "legs seen", "value": 3.0, "expected": 4.0, "unit": "", "setting": ""}
EXPLAINED: dict[str, Any] = {
    "verdict": "failed",
    "cause": "failed to find rack: 3 of 4 legs",
    "advice": "look there",
    "things": [LEG, WALL],
    "measures": [SEEN],
}
NAMED = Explained(
    words=("3 of 4 legs",),
    things=(
        NamedThing(kind="rack leg", role="expected", at=(1.2, 2.0)),
        NamedThing(kind="virtual wall", name="north"),
    ),
    measures=("legs seen",),
)


def judged(named: Explained, **found: Any) -> tuple[str, ...]:
    outcome = replace(GOOD, explained=EXPLAINED | found)
    return judge(EXPECT.model_copy(update={"explain": named}), outcome)


def test_an_explanation_that_names_the_cause_has_no_problem() -> None:
    assert judged(NAMED) == ()


@pytest.mark.parametrize(
    ("found", "text"),
    [
        ({"verdict": "stuck"}, "the verdict is 'stuck', expected 'failed'"),
        ({"advice": ""}, "no advice"),
        ({"cause": "no rack"}, "expected '3 of 4 legs' in it"),
        ({"things": [WALL]}, "explain names blocks virtual wall 'north' at (3.0, 0.0); expected {'kind': 'rack leg'"),
        ({"things": [LEG | {"pos": [1.5, 2.0]}, WALL]}, "expected {'kind': 'rack leg'"),
        ({"things": [LEG | {"role": "seen"}, WALL]}, "expected {'kind': 'rack leg'"),
        ({"things": [LEG, WALL | {"name": "south"}]}, "expected {'kind': 'virtual wall'"),
        ({"things": [LEG, WALL | {"clearance": 0.2}]}, "has the clearance 0.2 m, and needs 0.05 m"),
        ({"measures": []}, "explain measures nothing; expected 'legs seen'"),
        ({"measures": [SEEN | {"value": 4.0}]}, "legs seen is 4, which is within what was expected"),
        ({"measures": [SEEN | {"unit": "s"}]}, "legs seen is 3, which is within what was expected"),
    ],
)
def test_what_an_explanation_does_not_name_is_a_problem(found: dict[str, Any], text: str) -> None:
    (problem,) = judged(NAMED, **found)
    assert text in problem
