"""Whole rack jobs in a real cell, by a client that reads only the API; the judge alone knows where the rack is."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.testing import Cell, Judge, distance, turn, without_arms
from tests.system.api_client import ApiClient

MakeCell = Callable[..., Cell]
FROM, TO = (7.8, 9.4), (5.8, 9.4)  # rack points s8, which has a rack, and s7, which has none
UP = math.pi / 2
WIDTH, WITH_RACK = 0.46, 0.93  # m, of /robot_model: body; a standard rack with its margins


def check_set_down(judge: Judge, rack: str) -> None:
    true = judge.true_pose(rack)
    assert distance(true, *TO) <= 0.03
    assert abs(turn(true.yaw, UP)) <= math.radians(1.0)


def align(client: ApiClient) -> None:
    client.succeed("align_with_rack", target_x=FROM[0], target_y=FROM[1], target_ori=UP)
    client.wait("/load_state", lambda load: load["state"] == "under_rack", "the robot is under the rack")
    assert client.seen["/robot_model"]["width"] == pytest.approx(WIDTH, abs=0.01)


def set_down_and_leave(client: ApiClient, judge: Judge) -> None:
    client.jack("down")
    client.wait("/robot_model", lambda model: model["width"] < WIDTH + 0.01, "the footprint is the body's again")
    client.wait("/load_state", lambda load: load["state"] == "under_rack", "the rack is on the floor")
    client.succeed("standard", target_x=5.5, target_y=7.5)
    client.wait("/load_state", lambda load: load["state"] == "free", "the robot is out from under the rack")
    check_set_down(judge, "rack_s8")


def test_a_rack_job_from_point_to_point_in_lockstep(make_cell: MakeCell, tmp_path: Path) -> None:
    cell = make_cell(world=without_arms(tmp_path), seed=5)
    with Judge(cell.bus) as judge, ApiClient(cell.http) as client:
        align(client)
        client.jack("up")
        client.wait(
            "/robot_model", lambda model: model["width"] > WITH_RACK - 0.03, "the footprint grows to the rack's"
        )
        assert client.seen["/jack_state"]["weight"] > 60.0
        assert client.order("GET", "/chassis/jack")["load"] == "carrying"
        pose = client.order("GET", "/services/query_pose/rack_pose")["pose"]["pos"]
        true = judge.true_pose("rack_s8")
        assert math.hypot(pose[0] - true.x, pose[1] - true.y) < 0.05

        client.succeed("to_unload_point", target_x=TO[0], target_y=TO[1], target_ori=UP)
        set_down_and_leave(client, judge)
        assert judge.inspect().contact_count == 0


def test_a_job_is_resumed_after_the_planner_was_killed_while_carrying(make_cell: MakeCell, tmp_path: Path) -> None:
    """The client is the naive one, which posts the next move while the jack rises: it is held until the jack is up.

    In lockstep too the world goes on without the planner; no test of timing, so a busy machine does not matter.
    """
    cell = make_cell(world=without_arms(tmp_path), seed=7)
    with Judge(cell.bus) as judge, ApiClient(cell.http) as client:
        align(client)
        client.service("jack_up")
        client.wait("/jack_state", lambda jack: 0.1 < jack["progress"] < 0.7, "the jack is on its way")
        place = judge.true_pose("amr1")
        move = client.post("to_unload_point", target_x=TO[0], target_y=TO[1], target_ori=UP)
        held = client.wait(
            "/planning_state", lambda state: state["action_id"] == move and "message" in state, "the move is held"
        )
        assert held["move_state"] == "moving" and held["message"].startswith("the jack is moving up")
        client.wait("/jack_state", lambda jack: jack["progress"] > 0.85, "the jack is nearly up")
        assert distance(judge.true_pose("amr1"), place.x, place.y) < 0.005, "it moved with a half-raised jack"

        client.wait_until_driven(0.4)
        former = cell.kill("planner")
        cell.wait_until_restarted("planner", former)
        cell.wait_until_up()
        record = client.order("GET", f"/chassis/moves/{move}")
        assert (record["state"], record["fail_reason"]) == ("failed", MoveFailReason.PLATFORM_ALERT_ERROR), record
        assert client.order("GET", "/chassis/jack")["load"] == "carrying"
        client.wait("/planning_state", lambda state: state["move_state"] == "failed", "the move is told to have failed")
        assert client.seen["/robot_model"]["width"] == pytest.approx(WITH_RACK, abs=0.03)

        client.succeed("to_unload_point", target_x=TO[0], target_y=TO[1], target_ori=UP)
        set_down_and_leave(client, judge)
        assert judge.inspect().contact_count == 0
