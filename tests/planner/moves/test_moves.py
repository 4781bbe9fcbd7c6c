"""Moves as clients see them: accepted, replaced, cancelled, ended; each fail reason of the core by its cause."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.chassis import Jack, JackRequest
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import SelectMap
from rackhand.schemas.moves import DEPRECATED_MOVE_TYPES, MOVE_TYPES, GetMove, ListMoves, MoveRequest
from rackhand.schemas.refusal import RequestRefused
from rackhand.services.planner.behaviors.registry import BEHAVIORS
from rackhand.services.planner.chassis_settings import ChassisSettings
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.jacking import TIME_LIMIT_NS
from rackhand.services.planner.moves.book import TARGET_MISSING
from tests.planner.fakes import ARRIVED, FORWARD, STEP, UNIX_NS, Cell, Script, driving
from tests.planner.test_parameters import put


def test_a_move_is_moving_in_the_answer_and_before_it_was_reported(cell: Cell) -> None:
    cell.tick(30)
    move = cell.create(creator="me", target_ori=1.5, target_accuracy=0.1, properties={"rack_layer": 2, "x": [1, None]})
    assert (move.state, move.creator, move.fail_reason) == ("moving", "me", 0)
    assert move.properties == {"rack_layer": 2, "x": [1, None]}
    assert move.create_time == move.last_modified_time == (UNIX_NS + cell.stamp) // NANOSECONDS == 1_700_000_001
    assert cell.planning().move_state == "moving"
    assert cell.planning().action_id == move.id
    assert cell.script.requests == [], "asking must not cost a plan"


def test_a_move_drives_and_succeeds(cell: Cell) -> None:
    cell.script.ticks = [*[driving(2.0)] * 6, ARRIVED]
    move = cell.create(target_ori=0.5, target_accuracy=0.2, use_target_zone=True, properties={"inplace_rotate": True})
    assert cell.tick().twist == FORWARD
    (request,) = cell.script.requests
    assert (request.target_x, request.target_ori, request.target_accuracy) == (3.0, 0.5, 0.2)
    cell.tick(5)
    assert cell.planning().remaining_distance == 2.0
    assert cell.tick().twist.linear == pytest.approx(FORWARD.linear - 2.0 * 0.04), "it brakes"
    assert cell.get(move.id).state == "succeeded"
    assert cell.planning().move_state == "succeeded"
    assert cell.events() == ["created", "succeeded"]
    with pytest.raises(RequestRefused, match="no move is active"):
        cell.chassis.moves(MoveRequest(request=GetMove()))


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"target_x": None, "target_y": None}, TARGET_MISSING),
        ({"target_y": None}, TARGET_MISSING),
        ({"type": "align_with_rack", "target_x": None, "target_y": None}, TARGET_MISSING),
        ({"type": "standard", "target_x": None, "target_y": None, "rack_area_id": "a"}, TARGET_MISSING),
        ({"target_y": None, "target_ori": 1.0}, "target_x and target_y must be provided together"),
        ({"properties": {"inplace_rotate": "yes"}}, "properties.inplace_rotate is 'yes', want true or false"),
        ({"properties": {"rack_layer": "top"}}, "properties.rack_layer is 'top', want an integer from 0 on"),
        ({"properties": {"rack_layer": True}}, "properties.rack_layer is True, want an integer from 0 on"),
        ({"properties": {"rack_layer": 1.0}}, "properties.rack_layer is 1.0, want an integer from 0 on"),
    ],
)
def test_what_is_not_well_formed_is_refused_and_changes_nothing(cell: Cell, fields: dict[str, Any], text: str) -> None:
    running = cell.create()
    with pytest.raises(RequestRefused) as refused:
        cell.create(**fields)
    assert (refused.value.code, refused.value.text) == ("invalid", text)
    assert cell.get(running.id).state == "moving"


def test_only_a_charge_move_says_whether_it_charges(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(behaviors={"charge": (script := Script())})
    for kind, ticks, expected in [("charge", [ARRIVED], True), ("charge", [], False), ("standard", [ARRIVED], None)]:
        script.ticks, cell.script.ticks = list(ticks), list(ticks)
        move = cell.create(type=kind)
        assert move.is_charging is None
        if not ticks:
            cell.cancel(move.id)
        cell.tick(2)
        assert cell.get(move.id).is_charging is expected


@pytest.mark.parametrize("bad", [{"a": float("nan")}, {"a": b"bytes"}, {"a": {1: 2}}, {"a": [[]]}])
def test_properties_are_plain_json(cell: Cell, bad: dict[str, Any]) -> None:
    if bad == {"a": [[]]}:
        for _ in range(5000):
            bad = {"a": bad}
    with pytest.raises(RequestRefused, match="properties: not plain JSON"):
        cell.create(properties=bad)


@pytest.mark.parametrize(
    "fields",
    [
        {"type": "follow_target"},
        {"type": "along_given_route", "route_coordinates": "0, 0, 1, 1"},
        {"type": "align_with_rack", "rack_area_id": "area"},
        {"type": "to_unload_point", "rack_area_id": "area"},
        {"type": "leave_elevator"},
        {"type": "standard", "target_ori": 1.0},
        {"type": "none", "target_ori": 1.0},
    ],
)
def test_moves_that_need_no_point_are_accepted_without(cell: Cell, fields: dict[str, Any]) -> None:
    assert cell.create(**({"target_x": None, "target_y": None} | fields)).state == "moving"


def test_target_ori_alone_keeps_the_place(cell: Cell) -> None:
    cell.create(target_x=None, target_y=None, target_ori=1.0)
    cell.tick()
    (request,) = cell.script.requests
    assert (request.target_x, request.target_y, request.target_ori) == (None, None, 1.0)


@pytest.mark.parametrize("kind", MOVE_TYPES)
def test_every_type_is_accepted_and_ends_honestly(cell: Cell, kind: str) -> None:
    cell.script.ticks = [ARRIVED]
    move = cell.create(type=kind)
    cell.tick()
    ended = cell.get(move.id)
    if kind in ("none", "standard"):
        assert ended.state == "succeeded"
    elif kind in DEPRECATED_MOVE_TYPES:
        assert (ended.state, ended.fail_reason) == ("failed", 1004)
    else:
        assert ended.state == "moving" or (ended.fail_reason > MoveFailReason.UNKNOWN and ended.fail_message)
    assert set(BEHAVIORS) == set(MOVE_TYPES)


def test_a_new_move_replaces_the_running_one(cell: Cell) -> None:
    first = cell.create()
    cell.tick(3)
    second = cell.create(target_x=-1.0)
    assert second.id > first.id
    old = cell.get(first.id)
    assert (old.state, old.fail_reason, old.fail_message) == ("cancelled", 0, "replaced by a newer move")
    assert cell.tick().twist == FORWARD, "it goes on driving"
    assert [request.target_x for request in cell.script.requests] == [3.0, -1.0]
    assert cell.events() == ["created", "replaced", "created"]
    states = [(s.action_id, s.move_state) for s in cell.heard(topics.PLANNING_STATE) if s.action_id]
    assert states[0] == (first.id, "moving")
    assert states[-1] == (second.id, "moving")


def test_cancelling_brakes_to_a_stop(cell: Cell) -> None:
    move = cell.create()
    cell.tick(3)
    assert cell.cancel().state == "cancelled"
    assert cell.planning().move_state == "cancelled"
    speeds = [cell.tick().twist.linear for _ in range(10)]
    assert speeds == sorted(speeds, reverse=True)
    assert 0 < speeds[0] < FORWARD.linear
    assert cell.tick().twist == STANDSTILL
    with pytest.raises(RequestRefused, match=f"move {move.id} is cancelled and cannot be changed") as refused:
        cell.cancel(move.id)
    assert refused.value.code == "precondition"


@pytest.mark.parametrize(("move_id", "text"), [(None, "no move is active"), (77, "there is no move 77"), (2**70, "no")])
def test_cancelling_what_is_not_there(cell: Cell, move_id: int | None, text: str) -> None:
    with pytest.raises(RequestRefused, match=text) as refused:
        cell.cancel(move_id)
    assert refused.value.code == "not_found"


def test_navigation_s_failure_is_the_move_s(cell: Cell) -> None:
    cell.script.ticks = [
        driving(),
        MoveFailed(MoveFailReason.MOVE_TIMEOUT, "blocked for 60 s at (1, 2)"),
    ]
    move = cell.create()
    cell.tick(2)
    ended = cell.get(move.id)
    assert (ended.state, ended.fail_reason) == ("failed", 15)
    assert ended.fail_message == "blocked for 60 s at (1, 2)"
    assert cell.planning().fail_reason == 15
    assert 0 < cell.twist.linear < FORWARD.linear, "and it brakes"
    assert cell.create().state == "moving"


@pytest.mark.parametrize("reason", [3, 4, 5, 6, 7, 9, 11])
def test_a_hopeless_target_is_accepted_and_fails(cell: Cell, reason: int) -> None:
    cell.script.ticks = [MoveFailed(MoveFailReason(reason), "why")]
    move = cell.create()
    assert move.state == "moving"
    cell.tick()
    assert (cell.get(move.id).fail_reason, cell.get(move.id).fail_message) == (reason, "why")


def test_without_a_map_it_fails_with_2(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(with_map=False)
    move = cell.create()
    cell.tick()
    assert cell.get(move.id).fail_reason == MoveFailReason.GET_MAP_FAILED
    assert "no map is in use" in cell.get(move.id).fail_message


def test_changing_or_clearing_the_map_fails_it_with_1003(cell: Cell) -> None:
    move = cell.create()
    cell.tick()
    cell.ask_maps(SelectMap(id=1))
    ended = cell.get(move.id)
    assert (ended.fail_reason, ended.fail_message) == (1003, "the map was changed to 'hall' during the move")
    move = cell.create()
    cell.ask_maps(SelectMap())
    assert cell.get(move.id).fail_reason == 1003
    assert "cleared" in cell.get(move.id).fail_message


def test_a_power_cable_fails_it_with_17(cell: Cell) -> None:
    move = cell.create()
    cell.tick()
    cell.contacts["power_cable"] = True
    cell.tick()
    assert cell.get(move.id).fail_reason == MoveFailReason.POWER_CABLE_CONNECTED
    move = cell.create()
    cell.tick()
    assert cell.get(move.id).fail_reason == MoveFailReason.POWER_CABLE_CONNECTED


def test_a_lost_driver_fails_it_with_1000_and_the_next_one_works(cell: Cell) -> None:
    move = cell.create()
    cell.tick()
    cell.chassis.reset("the chassis driver disconnected")
    cell.chassis.set_driver_fault("the chassis driver disconnected")
    ended = cell.get(move.id)
    assert (ended.state, ended.fail_reason) == ("failed", 1000)
    assert ended.fail_message == "the chassis driver disconnected during the move"
    with pytest.raises(RequestRefused, match="the chassis driver disconnected") as refused:
        cell.create()
    assert refused.value.code == "unavailable"
    assert cell.heard(topics.CHASSIS_STATUS)[-1].driver_alive is False
    cell.stamp, cell.twist = -40_000_000, STANDSTILL
    cell.chassis.set_driver_fault("")
    cell.script.ticks = [ARRIVED]
    move = cell.create()
    cell.tick()
    assert cell.get(move.id).state == "succeeded"


def test_a_lost_position_stops_it_and_fails_it_only_if_it_lasts(cell: Cell) -> None:
    move = cell.create()
    cell.tick(5)
    cell.pose_alive = False
    cell.tick(100)
    assert cell.twist == STANDSTILL
    assert cell.get(move.id).state == "moving"
    assert [alert.code for alert in cell.heard(topics.CHASSIS_STATUS)[-1].alerts] == [1013, 7005]
    cell.pose_alive = True
    assert cell.tick().twist == FORWARD, "it goes on"
    assert cell.heard(topics.CHASSIS_STATUS)[-1].alerts == ()
    cell.quality = 1
    cell.tick(260)
    ended = cell.get(move.id)
    assert (ended.state, ended.fail_reason) == ("failed", 1000)
    assert ended.fail_message == "the localiser has lost the position; the move waited for 10 s"


def test_short_losses_of_the_position_do_not_add_up(cell: Cell) -> None:
    move = cell.create()
    for _ in range(3):
        cell.pose_alive = False
        cell.tick(150)
        cell.pose_alive = True
        cell.tick()
    assert cell.get(move.id).state == "moving"


def test_a_pose_of_the_former_run_is_not_driven_by(cell: Cell) -> None:
    cell.tick(100)
    cell.chassis.reset("reset")
    cell.stamp, cell.pose_alive = -40_000_000, False
    cell.create()
    cell.tick(5)
    assert cell.script.steps == 0


def test_an_error_in_a_tick_fails_the_move_with_1002_and_brakes(cell: Cell, monkeypatch: pytest.MonkeyPatch) -> None:
    cell.script.ticks = [driving(), ZeroDivisionError("by zero")]
    move = cell.create()
    cell.tick()
    with pytest.raises(ZeroDivisionError) as raised:
        cell.tick()
    command = cell.chassis.fail_internally(raised.value)
    assert 0 < command.twist.linear < FORWARD.linear
    assert command.answers == cell.stamp
    assert (cell.get(move.id).fail_reason, cell.get(move.id).fail_message) == (1002, "ZeroDivisionError: by zero")
    assert cell.planning().fail_reason == 1002
    monkeypatch.setattr(cell.motion, "perceive", None)  # broken for good
    for _ in range(20):
        command = cell.chassis.fail_internally(raised.value)
    assert command.twist == STANDSTILL


def jack(state: Any, progress: float) -> Jack:
    return Jack(stamp=0, state=state, progress=progress, weight=0.0)


def test_a_move_asked_for_while_the_jack_travels_starts_when_it_has_arrived(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(jack=jack("hold", 0.0))
    cell.ask(JackRequest(direction="up"))
    cell.tick()
    cell.jack = jack("jacking_up", 0.4)
    move = cell.create()
    assert (move.state, cell.get(move.id).state) == ("moving", "moving")
    for _ in range(100):
        command = cell.tick()
        assert (command.twist, command.jack) == (STANDSTILL, "up")
    assert cell.planning().message == "the jack is moving up; the move starts when it has arrived"
    assert (cell.planning().move_state, cell.planning().stuck_state) == ("moving", "none")
    cell.jack = jack("hold", 1.0)
    cell.tick(2)
    assert cell.twist == FORWARD
    assert cell.planning().message == ""


def test_a_move_that_waits_for_a_jack_that_does_not_arrive_fails(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(jack=jack("hold", 0.2))
    cell.ask(JackRequest(direction="up"))
    move = cell.create()
    cell.tick(TIME_LIMIT_NS // STEP + 5)
    ended = cell.get(move.id)
    assert (ended.state, ended.fail_reason) == ("failed", MoveFailReason.PLATFORM_ALERT_ERROR)
    assert ended.fail_message == "the jack did not move up in time: it is at 20% after 40 s"


@pytest.mark.parametrize("by_client", [False, True])
def test_an_option_or_a_client_s_setting_refuses_moves_while_the_jack_travels(
    make_cell: Callable[..., Cell], by_client: bool
) -> None:
    cell = make_cell(jack=jack("hold", 0.0), settings=ChassisSettings(refuse_moves_while_jacking=not by_client))
    if by_client:
        put(cell, refuse_moves_while_jacking=True)
    cell.ask(JackRequest(direction="up"))
    with pytest.raises(RequestRefused, match="the jack is moving up; wait until it has arrived") as refused:
        cell.create()
    assert refused.value.code == "precondition"
    put(cell, refuse_moves_while_jacking=False)
    assert cell.create().state == "moving"


def test_the_jack_does_not_start_while_a_move_runs(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(jack=jack("hold", 0.0))
    move = cell.create()
    with pytest.raises(RequestRefused, match=f"move {move.id} is running") as refused:
        cell.ask(JackRequest(direction="up"))
    assert refused.value.code == "precondition"


def test_stuck_is_reported_as_state_alert_and_event(cell: Cell) -> None:
    cell.script.ticks = [driving(), driving(stuck_state="move_stucked"), driving(stuck_state="move_stucked")]
    cell.create()
    cell.tick(2)
    assert cell.planning().stuck_state == "move_stucked"
    assert [alert.code for alert in cell.heard(topics.CHASSIS_STATUS)[-1].alerts] == [1007]
    cell.tick(2)
    assert cell.planning().stuck_state == "none"
    assert cell.events() == ["created", "blocked", "unblocked"]


def test_the_list_is_newest_first_and_pages(cell: Cell) -> None:
    ids = [cell.create().id for _ in range(5)]

    def listed(**page: int) -> list[int]:
        return [move.id for move in cell.chassis.moves(MoveRequest(request=ListMoves(**page))).moves]

    assert listed() == ids[::-1]
    assert listed(offset=1, limit=2) == ids[::-1][1:3]
    assert listed(offset=9) == []


def test_planning_state_and_path_rates(cell: Cell) -> None:
    cell.script.ticks = [driving(10 - 0.02 * i) for i in range(100)]
    cell.create()
    before = len(cell.heard(topics.PLANNING_STATE)), len(cell.heard(topics.PATH))
    cell.tick(100)  # 4 s
    assert 20 <= len(cell.heard(topics.PLANNING_STATE)) - before[0] <= 22
    assert 20 <= len(cell.heard(topics.PATH)) - before[1] <= 22
    cell.cancel()
    assert len(cell.heard(topics.PATH)[-1].poses) == 0
    cell.tick(5)
    told = len(cell.heard(topics.PLANNING_STATE))
    cell.tick(50)
    assert len(cell.heard(topics.PLANNING_STATE)) == told, "nothing new, nothing told"


def test_the_first_state_is_reported_before_anything_is_asked(cell: Cell) -> None:
    assert cell.heard(topics.PLANNING_STATE)[0].move_state == "none"
    assert cell.heard(topics.MAP)[0].map.map_name == "hall"
    assert cell.heard(topics.CHASSIS_STATUS)[0].control_mode == "auto"


def test_what_the_planner_steers_by_is_reported_once_a_second(cell: Cell) -> None:
    cell.tick(60)
    stamps = [costmap.stamp for costmap in cell.heard(topics.COSTMAP)]
    assert [stamp // 1_000_000_000 for stamp in stamps] == [0, 1, 2]
    cell.ask_maps(SelectMap())
    cell.tick(60)
    assert len(cell.heard(topics.COSTMAP)) == 3, "without a map there is nothing to steer by"
