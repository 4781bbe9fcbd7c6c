"""The default cell at work as a whole: the chassis drives and the arm moves, in lockstep."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rackhand.schemas.world import Pause, Reset
from rackhand.services.controller.ik import load_arm
from rackhand.testing import Cell, Judge, distance
from tests.system.driving import Driver, standard

HOME = load_arm("ur5e").home
GOAL = HOME + 0.25
SECONDS = 12.0
ARM = "/motion/arm1/command"


def run(cell: Cell, resets: int = 1) -> tuple[str, dict[str, Any], list[float], list[str]]:
    """A world begun anew, so many times in a row, and a move and an arm path from its first instant on.

    Returns the digest after so long, the move, where the arm's joints are, and what has been touched.
    """
    with Judge(cell.bus) as judge:
        driver = Driver(cell, judge)
        judge.ask(Pause(paused=True))
        for _ in range(resets):
            judge.ask(Reset(seed=3))
            driver.wait(lambda world: len(world.participants) == len(world.command_stamps) == 2, "both have answered")
        cell.wait_for(lambda: status if (status := arm_status(driver))["status"] == "initialize" else None, "a state")
        move = driver.post(standard(6.0, 1.5, 0.0))
        path = {"command": "appendPath", "type": "joints", "data": [(HOME + 0.1).tolist(), GOAL.tolist()]}
        assert driver.request("POST", ARM, {"priority": 10, **path})["message"]["value"] is True
        world = judge.advance(SECONDS)
        joints = arm_status(driver)["jointPositions"]["value"]
        result = world.digest, driver.move(move), joints, [f"{row.robot}-{row.other}" for row in world.contacts]
        assert distance(judge.true_pose("amr1"), 6.0, 1.5) < 0.06
        driver.close()
        return result


def arm_status(driver: Driver) -> dict[str, Any]:
    return dict(driver.request("POST", ARM, {"command": "getStatus"})["message"])


def test_a_move_and_an_arm_path_at_the_same_time_twice_the_same(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell()
    digest, move, joints, touched = run(cell)
    assert move["state"] == "succeeded", move
    np.testing.assert_allclose(joints, GOAL, atol=1e-4)
    assert touched == []
    again, *_ = run(cell, resets=2)  # also where what was measured last has the very stamps of what is measured next
    assert again == digest
