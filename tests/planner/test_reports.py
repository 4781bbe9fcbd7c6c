"""What ``/planning_state`` is made of: the last move, and what its behaviour reports."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.moves import INTENT_MOVE_TYPES, MOVE_TYPES, Move
from rackhand.services.planner.behaviors.base import Status
from rackhand.services.planner.behaviors.running import RunningMove
from rackhand.services.planner.reports import planning_state
from tests.planner.plant import Hall

HALL = Hall(4.0, 4.0).map()
REQUESTED, KNOWN = Pose2(x=1.0, y=2.0, yaw=3.0), Pose2(x=1.1, y=2.1, yaw=3.1)


def move(kind: str, **fields: Any) -> Move:
    target = {"target_x": 1.0, "target_y": 2.0, "target_ori": 3.0}
    return Move(
        **{"id": 5, "type": kind, "state": "moving", "create_time": 0, "last_modified_time": 0} | target | fields
    )


@pytest.mark.parametrize("kind", MOVE_TYPES)
def test_a_move_has_a_target_or_an_intent_target(kind: str) -> None:
    for status, pose in ((Status(), REQUESTED), (Status(target=KNOWN, intent_target=KNOWN), KNOWN)):
        state = planning_state(7, HALL, move(kind), None, status, 2.5)
        intent = kind in INTENT_MOVE_TYPES
        assert (state.target, state.intent_target) == ((None, pose) if intent else (pose, None))
        assert (state.action_type, state.map_uid, state.remaining_distance, state.stamp) == (kind, "hall", 2.5, 7)


def test_in_elevator_is_where_the_chassis_is_whatever_the_move_and_a_notice_is_the_message() -> None:
    waits = Status(flags=frozenset({"is_waiting_for_dest"}), notice="the lift's door is closed")
    state = planning_state(0, HALL, move("enter_elevator"), None, waits, 2.0, in_lift=True)
    assert (state.flags, state.message) == (("in_elevator", "is_waiting_for_dest"), "the lift's door is closed")
    ended = move("standard", state="succeeded")
    assert planning_state(0, HALL, ended, None, Status(), 0.0, in_lift=True).flags == ("in_elevator",)
    assert planning_state(0, HALL, ended, None, Status(), 0.0).flags == ()
    assert planning_state(0, HALL, None, None, Status(), 0.0, in_lift=True).flags == ()


def test_before_any_move() -> None:
    state = planning_state(7, HALL, None, None, Status(), 0.0)
    assert (state.action_id, state.action_type, state.move_state, state.target) == (0, "none", "none", None)


def test_flags_and_passed_points_go_out_and_a_hold_takes_precedence_over_an_old_message() -> None:
    status = Status(flags=frozenset({"in_elevator", "aligning_with_rack"}), passed_points=3)
    running = RunningMove(move("standard"), {})
    running.hold("the emergency stop is on")
    state = planning_state(0, None, move("standard", fail_message="before"), running, status, 0.0)
    assert (state.flags, state.passed_points) == (("aligning_with_rack", "in_elevator"), 3)
    assert state.message == "the emergency stop is on"
