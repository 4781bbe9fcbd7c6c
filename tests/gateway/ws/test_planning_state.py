"""``/planning_state`` of every move type against the documented examples: keys, types and what is absent."""

from __future__ import annotations

import json
from typing import Any, get_args

import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.moves import INTENT_MOVE_TYPES, MOVE_TYPES, PlanningFlag, PlanningState
from rackhand.services.gateway.ws import payloads
from rackhand.services.gateway.ws.broadcast import frame
from rackhand.services.gateway.ws.facts import Facts

# The example of the Move API's documentation (seeds 000, 001 and 004), to the letter.
DOCUMENTED = json.loads("""{
  "topic": "/planning_state", "move_state": "moving",
  "target_poses": [{"pos": [2.3, 20.82], "ori": 0}],
  "charger_pose": {"pos": [0, 0], "ori": 0}, "going_back_to_charger": false,
  "action_id": 4410, "fail_reason": 0, "fail_reason_str": "none",
  "remaining_distance": 3.546117067337036, "move_intent": "none",
  "intent_target_pose": {"pos": [0, 0], "ori": 0}, "stuck_state": "none"}""")
# That of the WebSocket documentation, which has all newer fields.
NEWER = json.loads("""{"topic":"/planning_state","map_uid":"xxxxxx",
 "action_id":3354,"action_type":"enter_elevator","move_state":"moving",
 "fail_reason":0,"fail_reason_str":"none","remaining_distance":2.875,
 "target_poses":[{"pos":[4.08,2.99],"ori":0}],
 "charger_pose":{"pos":[0,0],"ori":0},"going_back_to_charger":false,
 "move_intent":"none","intent_target_pose":{"pos":[0,0],"ori":0},
 "stuck_state":"none",
 "in_elevator":true,"viewport_blocked":true,"is_waiting_for_dest":true,
 "given_route_passed_point_count":3}""")
OPTIONAL = {"message", "paused", "viewport_blocked", *get_args(PlanningFlag)}
POSE = Pose2(x=4.08, y=2.99, yaw=0.0)


def wire(**fields: Any) -> dict[str, Any]:
    """The frame as a client reads it."""
    state = PlanningState(**{"stamp": 0, "move_state": "moving"} | fields)
    payload = payloads.planning_state(Facts({topics.PLANNING_STATE: state}))
    assert payload is not None
    frame_fields = json.loads(frame("/planning_state", payload))
    assert isinstance(frame_fields, dict)
    return frame_fields


def of_type(kind: str, **fields: Any) -> dict[str, Any]:
    goal = {"intent_target": POSE} if kind in INTENT_MOVE_TYPES else {"target": POSE}
    return wire(action_type=kind, action_id=7, map_uid="hall", **goal | fields)


def test_the_example_of_the_move_api() -> None:
    sent = wire(
        action_id=4410, action_type="standard", remaining_distance=3.546117067337036,
        target=Pose2(x=2.3, y=20.82, yaw=0.0),
    )  # fmt: skip
    assert {key: sent[key] for key in DOCUMENTED} == DOCUMENTED
    assert set(sent) - set(DOCUMENTED) == {"map_uid", "action_type", "given_route_passed_point_count"}


def test_the_example_of_the_websocket_documentation() -> None:
    sent = wire(
        map_uid="xxxxxx", action_id=3354, action_type="enter_elevator", remaining_distance=2.875, target=POSE,
        flags=("in_elevator", "is_waiting_for_dest"), viewport_blocked=True, passed_points=3,
    )  # fmt: skip
    assert sent == NEWER


@pytest.mark.parametrize("kind", MOVE_TYPES)
def test_every_move_type_has_the_documented_keys_of_the_documented_types(kind: str) -> None:
    sent = of_type(kind)
    assert set(sent) == set(NEWER) - OPTIONAL, "flags are absent while they are false"
    shapes = {key: type(value) for key, value in NEWER.items() if key in sent}
    assert {key: type(value) for key, value in sent.items()} == shapes | {"remaining_distance": float}
    assert sent["action_type"] == kind
    pose = {"pos": [4.08, 2.99], "ori": 0.0}
    if kind in INTENT_MOVE_TYPES:
        assert (sent["target_poses"], sent["intent_target_pose"]) == ([], pose)
    else:
        assert (sent["target_poses"], sent["intent_target_pose"]) == ([pose], DOCUMENTED["intent_target_pose"])


@pytest.mark.parametrize("flag", sorted(get_args(PlanningFlag)))
def test_a_flag_is_true_or_absent(flag: str) -> None:
    sent = of_type("standard", flags=(flag,))
    assert sent[flag] is True and set(sent) & OPTIONAL == {flag}


def test_a_paused_move_says_so_and_is_still_moving() -> None:
    sent = of_type("standard", paused=True, message="the move is paused on request")
    assert (sent["paused"], sent["move_state"], sent["message"]) == (True, "moving", "the move is paused on request")


@pytest.mark.parametrize(("state", "going"), [("moving", True), ("succeeded", False), ("failed", False)])
def test_going_back_to_the_charger_while_a_charge_move_runs(state: str, going: bool) -> None:
    sent = of_type("charge", move_state=state)
    assert sent["going_back_to_charger"] is going
    assert sent["move_intent"] == ("going_back_to_charger" if going else "none")
    assert sent["charger_pose"] == sent["intent_target_pose"] == {"pos": [4.08, 2.99], "ori": 0.0}
    assert of_type("align_with_rack")["charger_pose"] == DOCUMENTED["charger_pose"]


@pytest.mark.parametrize("state", ["none", "idle", "moving", "succeeded", "failed", "cancelled"])
@pytest.mark.parametrize("stuck", ["none", "move_stucked", "target_spin_stucked"])
def test_states_go_out_as_documented(state: str, stuck: str) -> None:
    sent = of_type("standard", move_state=state, stuck_state=stuck)
    assert (sent["move_state"], sent["stuck_state"]) == (state, stuck)
