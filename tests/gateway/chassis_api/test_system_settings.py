"""``/system/settings``: schema, defaults, what is set and what is in force; changes of some, of all, and refusals."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.schemas import topics
from rackhand.schemas.parameters import NAMES, ParameterChanges, SetParameters
from tests.gateway import messages
from tests.gateway.harness import Gateway

VELOCITY = "control.max_forward_velocity"
SPECS = "rack.specs"
S300 = {"width": 0.765, "depth": 0.765, "margin": [0.0925, 0.0925, 0.0925, 0.0925]}
FOOTPRINT = "robot.footprint"


@pytest.fixture
def described(gateway: Gateway) -> Gateway:
    """Its driver has described the chassis."""
    gateway.publish(topics.CHASSIS_MODEL, messages.model())
    return gateway


def get(gateway: Gateway, what: str) -> Any:
    answer = gateway.http.get(f"/system/settings/{what}")
    assert answer.status_code == 200, answer.text
    return answer.json()


def put(gateway: Gateway, method: str, body: dict[str, Any]) -> Any:
    answer = gateway.http.request(method, "/system/settings/user", json=body)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_the_schema_has_the_documented_rows(described: Gateway) -> None:
    rows = {row["name"]: row for row in get(described, "schema")["ax"]}
    assert list(rows) == [FOOTPRINT, *NAMES.values()]
    assert rows[VELOCITY] == {
        "name": VELOCITY,
        "title": "Control: Max Forward Velocity",
        "type": "float",
        "default": 1.2,
        "range": "[0, 1.2]",
        "description": "m/s; 0 holds a move without ending it, until it is raised",
    }
    assert rows["control.acc_smoother.smooth_level"]["options"] == ["disabled", "lower", "normal", "higher"]
    assert rows["control.acc_smoother.smooth_level"]["description"].startswith("limits the jerk")
    assert rows[FOOTPRINT]["default"] == [[0.2, -0.2], [0.2, 0.4], [-0.2, 0.4], [-0.2, -0.2]]
    assert {row["type"] for row in rows.values()} == {"float", "bool", "Enum", "Polygon", "RackSpecs"}
    for name, value in get(described, "default").items():
        assert rows[name]["default"] == value


def test_effective_is_default_with_user_over_it(described: Gateway) -> None:
    assert get(described, "user") == {}
    before = get(described, "default")
    assert get(described, "effective") == before
    changes = {VELOCITY: 0.8, "robot.footprint_expansion": 0.1, "safety.ignore_objects_under_rack": False}
    assert put(described, "PATCH", changes) == changes
    assert get(described, "user") == changes
    assert get(described, "effective") == before | changes
    assert get(described, "default") == before


def test_kinds_of_racks_are_kept_as_a_list_of_objects(described: Gateway) -> None:
    kinds = put(described, "PATCH", {SPECS: [S300, {"width": 0.64, "depth": 0.545, "alignment": "back"}]})[SPECS]
    assert get(described, "effective")[SPECS] == kinds
    assert [(kind["width"], kind["depth"], kind["alignment"]) for kind in kinds] == [
        (0.765, 0.765, "center"),
        (0.64, 0.545, "back"),
    ]
    assert kinds[0]["margin"] == S300["margin"] and kinds[1]["leg_shape"] == "square"


def test_patch_keeps_what_is_not_given_and_null_returns_to_the_default(described: Gateway) -> None:
    put(described, "PATCH", {VELOCITY: 0.8, SPECS: [S300]})
    assert list(put(described, "PATCH", {VELOCITY: 0.7, SPECS: None})) == [VELOCITY]
    assert get(described, "effective")[SPECS] == get(described, "default")[SPECS]
    (*_, asked) = [request for request in described.bus.requests if isinstance(request, SetParameters)]
    assert asked.changes == ParameterChanges(max_forward_velocity=0.7)
    assert (asked.reset, asked.replace) == (("rack_specs",), False)


def test_post_sets_these_and_no_others(described: Gateway) -> None:
    put(described, "PATCH", {VELOCITY: 0.8, "control.auto_hold": False})
    assert put(described, "POST", {VELOCITY: 0.5}) == {VELOCITY: 0.5}
    assert put(described, "POST", {}) == {}
    assert get(described, "effective") == get(described, "default")


def test_what_is_effective_may_be_written_back(described: Gateway) -> None:
    effective = get(described, "effective")
    put(described, "POST", effective)
    assert get(described, "effective") == effective


def test_the_older_interface_shows_the_same_values(described: Gateway) -> None:
    put(described, "PATCH", {VELOCITY: 0.8})
    assert described.http.get("/robot-params").json()["/wheel_control/max_forward_velocity"] == 0.8
    described.http.post("/robot-params", json={"/wheel_control/max_forward_velocity": 0.6})
    assert get(described, "user") == {VELOCITY: 0.6}


@pytest.mark.parametrize("method", ["POST", "PATCH"])
@pytest.mark.parametrize(
    ("body", "text"),
    [
        ({VELOCITY: 5}, f"{VELOCITY}: 5 is not in 0 … 1.2 m/s"),
        ({VELOCITY: "fast"}, f"{VELOCITY}: Input should be a valid number, got 'fast'"),
        ({"control.wings": 2}, "control.wings: Extra inputs are not permitted, got 2"),
        ({"max_forward_velocity": 0.5}, "max_forward_velocity: Extra inputs are not permitted, got 0.5"),
        ({SPECS: [S300, {"width": 0.8}]}, f"{SPECS}.1.depth: is missing"),
        ({SPECS: [S300 | {"width": -1}]}, f"{SPECS}.0.width: Input should be greater than 0, got -1"),
        ({SPECS: [S300 | {"margin": [0.1]}]}, f"{SPECS}.0.margin.1: is missing"),
        ({SPECS: [S300 | {"colour": "red"}]}, f"{SPECS}.0.colour: Extra inputs are not permitted, got 'red'"),
        ({SPECS: [S300 | {"leg_size": 0.4}]}, f"{SPECS}.0: width 0.765 is not more than two legs of leg_size 0.4"),
        ({SPECS: S300}, f"{SPECS}: Input should be a valid tuple, got an object of 3"),
        (
            {SPECS: [S300 | {"alignment": "left"}]},
            f"{SPECS}.0.alignment: Input should be 'center' or 'back', got 'left'",
        ),
        (
            {FOOTPRINT: [[0.2, -0.2], [0.2, 0.4], [-0.2, 0.4]]},
            f"{FOOTPRINT}: is that of the robot's description and cannot be changed here",
        ),
    ],
)
def test_one_bad_setting_is_named_and_nothing_changes(
    described: Gateway, method: str, body: dict[str, Any], text: str
) -> None:
    put(described, "PATCH", {"control.auto_hold": False})
    answer = described.http.request(method, "/system/settings/user", json={"control.auto_hold": True} | body)
    assert answer.status_code == 400
    assert text in answer.json()
    assert get(described, "user") == {"control.auto_hold": False}


def test_a_chassis_that_is_not_described_yet_is_unavailable(gateway: Gateway) -> None:
    for what in ("schema", "default", "effective"):
        assert gateway.http.get(f"/system/settings/{what}").status_code == 503
    assert gateway.http.patch("/system/settings/user", json={VELOCITY: 0.5}).status_code == 503
    assert gateway.bus.requests == []
