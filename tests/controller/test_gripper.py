"""``setGripper``: who may, what it does, and what it leaves alone."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.schemas.motion import Gripper
from tests.controller.cell import UR5E, PerfectArm

OFF, ON = Gripper(suction=False, holding=False), Gripper(suction=True, holding=False)


def suction(cell: PerfectArm) -> bool:
    """What the newest command to the driver says."""
    return cell.tick().suction


def test_it_is_switched_on_and_off_by_who_holds_control() -> None:
    cell = PerfectArm(gripper=OFF)
    assert not suction(cell)
    cell.ok("a", command="setGripper", suction=True)
    assert suction(cell)
    assert cell.get_status()["priorityUnderControl"] == 10
    refused = cell.ask("b", command="setGripper", priority=20, suction=False)
    assert refused["message"] == {"code": 403, "detail": 0}
    assert suction(cell)
    cell.ok("a", command="setGripper", suction=False)
    assert not suction(cell)
    assert [entry.action for entry in cell.audit].count("setGripper") == 3, "it is kept who did it"


def test_it_neither_stops_nor_queues_motion() -> None:
    quiet, used = PerfectArm(gripper=OFF), PerfectArm(gripper=OFF)
    for cell in (quiet, used):
        cell.ok("a", command="appendPath", type="joints", data=[(UR5E.home + 0.3).tolist()])
        cell.advance(0.2)
        if cell is used:
            cell.ok("a", command="setGripper", suction=True)
        cell.advance(0.004)
        assert cell.command is not None and cell.command.suction == (cell is used), "at once, while it moves"
        cell.advance(3.0)
    assert (used.driven()[0] == quiet.driven()[0]).all()


@pytest.mark.parametrize("field", [{}, {"suction": "on"}, {"suction": 1}, {"suction": None}])
def test_a_malformed_one_is_a_bare_400(field: dict[str, Any]) -> None:
    cell = PerfectArm(gripper=OFF)
    answer = cell.ask("a", command="setGripper", priority=10, **field)
    assert (answer["replyCommand"], answer["message"]) == ("error", 400)
    assert "suction" in answer["text"]


def test_an_arm_without_gripper_does_not_offer_it() -> None:
    cell = PerfectArm()
    answer = cell.ask("a", command="setGripper", priority=10, suction=True)
    assert answer["message"] == {"code": 405, "detail": 0}
    assert cell.get_status()["priorityUnderControl"] == 0, "and control is not taken"
    assert "gripper" not in cell.get_status()


def test_status_tells_what_the_driver_measures() -> None:
    cell = PerfectArm(gripper=OFF)
    assert cell.get_status()["gripper"] == {"suction": False, "holding": False}
    cell.gripper = Gripper(suction=True, holding=True)
    cell.advance(0.004)
    assert cell.get_status()["gripper"] == {"suction": True, "holding": True}


def test_stops_and_changes_of_holder_drop_nothing() -> None:
    cell = PerfectArm(gripper=OFF, keep_alive_ns=200_000_000)
    cell.ok("a", command="setGripper", suction=True)
    for stop in ("softStop", "hardStop"):
        assert cell.ask("b", command=stop)["message"]["value"] is True
        assert suction(cell)
    cell.advance(0.3)
    assert cell.get_status()["priorityUnderControl"] == 0, "expired"
    assert suction(cell)
    assert cell.ask("c", command="lockControl", priority=5)["message"] is True
    assert suction(cell)


@pytest.mark.parametrize("measured", [OFF, ON])
def test_a_controller_that_begins_adopts_what_it_finds(measured: Gripper) -> None:
    cell = PerfectArm(gripper=measured)
    assert suction(cell) == measured.suction
    cell.controller.reset("a test")
    cell.gripper = Gripper(suction=not measured.suction, holding=False)
    assert suction(cell) != measured.suction, "also after the driver has begun anew"


def test_nothing_is_switched_before_the_driver_is_there() -> None:
    cell = PerfectArm(gripper=OFF)
    cell.controller.reset("a test")
    assert cell.ask("a", command="setGripper", priority=10, suction=True)["message"]["code"] == 403
