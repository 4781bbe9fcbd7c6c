"""The arm of the warehouse picks a parcel off its table over the API, and holds it whatever happens to others."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import yaml

from rackhand.testing import Cell, Judge
from tests.system.cell import ROOT
from tests.system.driving import Driver

ARM = "/motion/arm1/command"
WORLD = yaml.safe_load((ROOT / "worlds" / "warehouse" / "world.yaml").read_text())
PARCEL = "parcel_red"
CUP = 0.12  # m, from the flange to the cup's mouth


class Picker:
    """A client of the arm in a paused world: time passes in ``advance`` only."""

    def __init__(self, cell: Cell, judge: Judge) -> None:
        self.cell, self.judge, self.driver = cell, judge, Driver(cell, judge)

    def ask(self, command: str, **fields: Any) -> dict[str, Any]:
        return dict(self.driver.request("POST", ARM, {"command": command, **fields}))

    def ok(self, command: str, **fields: Any) -> None:
        answer = self.ask(command, priority=10, **fields)
        assert answer["message"].get("value") is True, answer

    def status(self) -> dict[str, Any]:
        return dict(self.ask("getStatus")["message"])

    def wait_for_arm(self) -> None:
        joined = "arm1/controller"
        self.driver.wait(lambda world: joined in world.participants, "the controller has joined")
        self.advance(0.1)
        self.cell.wait_for(lambda: self.status()["status"] == "initialize" or None, "it has seen the arm")

    def go(self, *ways: tuple[float, float, float]) -> None:
        """The cup's mouth, pointing down, along points of the map (m); returns when it is there."""
        poses = [{"Position": self.in_base(x, y, z + CUP), "Orientation": DOWN} for x, y, z in ways]
        self.ok("appendPath", type="task", data=poses, method=2, reference=1)
        for _ in range(40):
            self.advance(0.5)
            if not self.status()["isTrajectoryRunning"]["value"]:
                return
        raise AssertionError(f"still moving: {self.status()}")

    def in_base(self, x: float, y: float, z: float) -> list[float]:
        place = WORLD["arms"]["arm1"]
        dx, dy, yaw = x - place["pose"][0], y - place["pose"][1], place["pose"][2]
        cos, sin = math.cos(yaw), math.sin(yaw)
        return [dx * cos + dy * sin, dy * cos - dx * sin, z - place["mount"]]

    def advance(self, seconds: float) -> None:
        self.judge.advance(seconds)

    def parcel(self) -> tuple[float, float, float]:
        """Where its middle truly is."""
        self.advance(0.1)
        return self.judge.objects()[PARCEL].position


# As the tool points at home: the flange's z down, its x along the base's y.
DOWN = {"Matrix": {"Row1": [0, 1, 0], "Row2": [1, 0, 0], "Row3": [0, 0, -1]}}


@pytest.fixture
def picker(make_cell: Callable[..., Cell]) -> Iterator[Picker]:
    cell = make_cell()
    with Judge(cell.bus) as judge:
        judge.pause()
        picker = Picker(cell, judge)
        picker.wait_for_arm()
        yield picker
        picker.driver.close()


def test_a_parcel_is_picked_and_kept_when_the_controller_is_killed(picker: Picker) -> None:
    x, y, middle = picker.parcel()
    lid = middle + WORLD["items"][PARCEL]["size"][2] / 2
    picker.go((x, y, lid + 0.1), (x, y, lid - 0.0005))
    assert picker.status()["gripper"] == {"suction": False, "holding": False}
    picker.ok("setGripper", suction=True)
    picker.advance(0.1)
    assert picker.status()["gripper"] == {"suction": True, "holding": True}
    picker.go((x, y, lid + 0.2))
    assert picker.parcel()[2] - middle == pytest.approx(0.2, abs=0.01)
    weight = WORLD["items"][PARCEL]["mass"] * 9.81
    force = picker.status()["taskForceTorque"]["value"]
    assert force[2] == pytest.approx(-weight - 0.4 * 9.81, rel=0.1), "parcel and gripper, in the base frame"

    former = picker.cell.kill("controller")
    picker.driver.wait(lambda world: "arm1/controller" not in world.participants, "it is missed")
    picker.advance(1.0)
    picker.cell.wait_until_restarted("controller", former)
    picker.wait_for_arm()
    status = picker.status()
    assert status["priorityUnderControl"] == 0
    assert status["gripper"] == {"suction": True, "holding": True}, "it goes on with what it found"
    assert picker.parcel()[2] - middle == pytest.approx(0.2, abs=0.01)

    picker.go((x + 0.2, y, lid + 0.2))
    picker.ok("setGripper", suction=False)
    picker.advance(1.0)
    lies = picker.parcel()
    assert math.hypot(lies[0] - x - 0.2, lies[1] - y) < 0.05
    assert lies[2] == pytest.approx(middle, abs=0.03)
    assert picker.judge.inspect().contacts == ()
