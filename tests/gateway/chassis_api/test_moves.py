"""Moves over HTTP: statuses, key order, error bodies, as measured on a real robot and as the seeds show them."""

from __future__ import annotations

from typing import Any

import httpx
import pytest

from rackhand.bus import CallTimeout, Refused, Unavailable
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.refusal import RefusalCode
from tests.gateway.fake_bus import NOW, TARGET_MISSING
from tests.gateway.harness import Gateway

FULL_KEYS = [
    "id",
    "creator",
    "state",
    "type",
    "target_x",
    "target_y",
    "target_z",
    "target_ori",
    "target_accuracy",
    "use_target_zone",
    "is_charging",
    "charge_retry_count",
    "fail_reason",
    "fail_reason_str",
    "fail_message",
    "create_time",
    "last_modified_time",
    "rack_area_id",
    "properties",
]
SHORT_KEYS = [
    "id",
    "creator",
    "state",
    "type",
    "fail_reason",
    "fail_reason_str",
    "fail_message",
    "create_time",
    "last_modified_time",
]
TARGET = {"creator": "test", "type": "standard", "target_x": -16.32, "target_y": 24.3, "target_ori": 0.75}


def post(gateway: Gateway, **body: Any) -> httpx.Response:
    return gateway.http.post("/chassis/moves", json=body)


def test_a_move_is_answered_201_with_the_whole_object_in_the_measured_order(gateway: Gateway) -> None:
    answer = post(gateway, **TARGET, properties={"planning_mode": "directional", "deep": [1, {"a": None}]}, speed=3)
    assert answer.status_code == 201
    assert list(answer.json()) == FULL_KEYS
    assert answer.json() == {
        **TARGET,
        "id": 1,
        "state": "moving",
        "target_z": None,
        "target_accuracy": None,
        "use_target_zone": None,
        "is_charging": None,
        "charge_retry_count": 0,
        "fail_reason": 0,
        "fail_reason_str": "None - None",
        "fail_message": "",
        "create_time": NOW,
        "last_modified_time": NOW,
        "rack_area_id": None,
        "properties": {"planning_mode": "directional", "deep": [1, {"a": None}]},
    }


@pytest.mark.parametrize("kind", ["enter_elevator", "return_to_elevator_waiting_point", "leave_elevator"])
def test_moves_of_lifts_have_the_same_form(gateway: Gateway, kind: str) -> None:
    answer = post(gateway, **TARGET | {"type": kind})
    assert (answer.status_code, list(answer.json())) == (201, FULL_KEYS)
    assert {key: answer.json()[key] for key in TARGET} == TARGET | {"type": kind}
    assert list(gateway.http.get("/chassis/moves").json()[0]) == SHORT_KEYS
    assert gateway.bus.requests[0].move.type == kind


@pytest.mark.parametrize(
    ("reason", "name"),
    [
        (300, "elevator_point_occupied - 电梯点被占用"),
        (301, "elevator_closed - 电梯门已关闭"),
        (302, "elevator_point_obscured_timeout - 电梯点长时间被遮挡"),
        (303, "elevator_point_occupancy_detection_timeout - 电梯点占用检测超时"),
        (304, "elevator_enter_progress_update_timeout - 进入电梯长时间无进展"),
    ],
)
def test_why_a_lift_was_not_entered_is_reported_in_the_words_of_rest(gateway: Gateway, reason: int, name: str) -> None:
    post(gateway, **TARGET | {"type": "enter_elevator"})
    gateway.bus.end(1, state="failed", fail_reason=reason, fail_message="why")
    row = gateway.http.get("/chassis/moves/1").json()
    assert (row["fail_reason"], row["fail_reason_str"], row["fail_message"]) == (reason, name, "why")


def test_defaults_are_those_of_a_real_robot(gateway: Gateway) -> None:
    answer = post(gateway, action="move_to", target_ori=0.75, charge_retry_count=None, properties=None).json()
    assert (answer["creator"], answer["type"]) == ("control_unit", "none")
    assert (answer["charge_retry_count"], answer["properties"]) == (0, {})


def test_route_and_detour_reach_the_planner_and_are_not_returned(gateway: Gateway) -> None:
    answer = post(gateway, type="along_given_route", route_coordinates="0, 0, 1, 1", detour_tolerance=0, target_ori=1)
    assert list(answer.json()) == FULL_KEYS
    sent = gateway.bus.requests[-1].move
    assert (sent.route_coordinates, sent.detour_tolerance) == ("0, 0, 1, 1", 0.0)


def test_the_list_is_short_objects_newest_first_and_pages_only_when_asked(gateway: Gateway) -> None:
    for _ in range(3):
        post(gateway, **TARGET)
    everything = gateway.http.get("/chassis/moves", params={"page": 2, "page_size": 1})
    assert [row["id"] for row in everything.json()] == [3, 2, 1]
    assert list(everything.json()[0]) == SHORT_KEYS
    assert [row["id"] for row in gateway.http.get("/chassis/moves?offset=1&limit=1").json()] == [2]


def test_current_is_the_running_move_and_404_as_soon_as_it_has_ended(gateway: Gateway) -> None:
    assert gateway.http.get("/chassis/moves/current").status_code == 404
    post(gateway, **TARGET)
    assert gateway.http.get("/chassis/moves/current").json()["id"] == 1
    gateway.bus.end(1, state="succeeded")
    assert gateway.http.get("/chassis/moves/current").json() == {"detail": "no move is active"}
    assert gateway.http.get("/chassis/moves/1").json()["state"] == "succeeded"
    assert gateway.http.get("/chassis/moves/latest").json()["id"] == 1


def test_why_a_move_failed_is_reported_in_the_words_of_rest(gateway: Gateway) -> None:
    post(gateway, **TARGET)
    gateway.bus.end(1, state="failed", fail_reason=501, fail_message="failed to find rack")
    answer = gateway.http.get("/chassis/moves/1").json()
    assert answer["fail_reason_str"] == "rack_detection_error - 未识别到货架"
    assert answer["fail_message"] == "failed to find rack"
    gateway.bus.end(1, fail_reason=4711)  # of a planner newer than this gateway
    answer = gateway.http.get("/chassis/moves/1").json()
    assert (answer["fail_reason"], answer["fail_reason_str"]) == (4711, MoveFailReason.UNKNOWN.rest_string)


@pytest.mark.parametrize("body", ['{state: "cancelled"}', '{"state": "cancelled"}', "{ state : 'cancelled' }"])
def test_cancelling_takes_the_body_as_the_documentation_writes_it(gateway: Gateway, body: str) -> None:
    post(gateway, **TARGET)
    headers = {"content-type": "application/json"}
    answer = gateway.http.patch("/chassis/moves/current", content=body, headers=headers)
    if "'" in body:  # that is no JSON in anyone's book
        assert answer.status_code == 400
        return
    assert (answer.status_code, answer.json()) == (200, {"state": "cancelled"})
    assert gateway.http.get("/chassis/moves/1").json()["state"] == "cancelled"


def test_cancelling_what_does_not_run(gateway: Gateway) -> None:
    cancel = {"state": "cancelled"}
    assert gateway.http.patch("/chassis/moves/current", json=cancel).status_code == 404
    assert gateway.http.patch("/chassis/moves/9", json=cancel).status_code == 404
    post(gateway, **TARGET)
    assert gateway.http.patch("/chassis/moves/1", json=cancel).status_code == 200
    ended = gateway.http.patch("/chassis/moves/1", json=cancel)
    assert (ended.status_code, ended.json()) == (400, {"detail": "move 1 is cancelled"})
    other = gateway.http.patch("/chassis/moves/1", json={"state": "succeeded"})
    assert other.status_code == 400
    assert other.json() == ["state: Input should be 'cancelled', 'paused' or 'moving', got 'succeeded'"]


@pytest.mark.parametrize("which", ["current", "1"])
def test_a_move_is_paused_and_resumed(gateway: Gateway, which: str) -> None:
    url = f"/chassis/moves/{which}"
    assert gateway.http.patch(url, json={"state": "paused"}).status_code == 404
    post(gateway, **TARGET)
    for state in ("paused", "paused", "moving"):
        answer = gateway.http.patch(url, json={"state": state})
        assert (answer.status_code, answer.json()) == (200, {"state": state})
    asked = [request.paused for request in gateway.bus.pauses]
    assert asked == [True, True, False]
    assert gateway.http.get("/chassis/moves/1").json()["state"] == "moving"
    gateway.http.patch(url, json={"state": "cancelled"})
    assert gateway.http.patch("/chassis/moves/1", json={"state": "moving"}).status_code == 400


def test_a_move_without_a_target_is_refused_in_the_real_robots_words(gateway: Gateway) -> None:
    answer = post(gateway, action="move_to", x=1, y=2, yaw=0)
    assert (answer.status_code, answer.json()) == (400, [TARGET_MISSING])


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ({"target_x": "1", "target_y": 2}, "target_x: Input should be a valid number, got '1'"),
        ({"target_x": 10**400, "target_y": 2}, "target_x: Input should be a valid number, got an integer of 1329 bits"),
        ({"target_ori": 0, "type": "fly"}, "type: Input should be 'none', 'standard'"),
        ({"target_ori": 0, "target_accuracy": -1}, "target_accuracy: Input should be greater than or equal to 0"),
        ({"target_ori": 0, "properties": [1]}, "properties: Input should be a valid dictionary, got a list of 1"),
        ({"target_ori": 0, "properties": {"a": 2**64}}, "moves.MoveRequest: cannot be encoded"),
        ([], "body: Input should be a valid dictionary or object to extract fields from, got a list of 0"),
    ],
)
def test_a_wrong_field_is_reported_by_name_with_what_was_expected(gateway: Gateway, body: Any, told: str) -> None:
    answer = gateway.http.post("/chassis/moves", json=body)
    assert answer.status_code == 400
    assert answer.json()[0].startswith(told)
    assert not gateway.bus.moves


@pytest.mark.parametrize("move_id", ["99", "abc", "-1", "1.5", str(2**63), "9" * 5000, "%00", "1e3"])
def test_an_id_that_names_no_move_is_404(gateway: Gateway, move_id: str) -> None:
    assert gateway.http.get(f"/chassis/moves/{move_id}").status_code == 404


@pytest.mark.parametrize(
    ("failure", "status", "body"),
    [
        (Unavailable("nobody serves moves"), 503, {"detail": "nobody serves moves"}),
        (CallTimeout("no answer in 2 s"), 503, {"detail": "no answer in 2 s"}),
        (Refused(RefusalCode.PRECONDITION, "the jack is moving"), 400, {"detail": "the jack is moving"}),
        (Refused(RefusalCode.INVALID, "odd count"), 400, ["odd count"]),
        (Refused(RefusalCode.MALFORMED, "bad"), 400, ["bad"]),
        (Refused(RefusalCode.NOT_FOUND, "no such"), 404, {"detail": "no such"}),
        (Refused(RefusalCode.UNAVAILABLE, "busy"), 503, {"detail": "busy"}),
        (Refused(RefusalCode.TIMEOUT, "late"), 503, {"detail": "late"}),
        (Refused(RefusalCode.INTERNAL, "assert"), 500, {"detail": "assert"}),
    ],
)
def test_what_the_bus_says_becomes_a_status(gateway: Gateway, failure: Any, status: int, body: Any) -> None:
    gateway.bus.failure = failure
    answer = post(gateway, **TARGET)
    assert (answer.status_code, answer.json()) == (status, body)
