"""Streams of velocities as clients send them: changing at every message, and turned round at the edge of reach."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.services.controller import ik
from tests.controller.cell import FR3, UR5E, PerfectArm

BOTH = pytest.mark.parametrize("arm", [UR5E, FR3], ids=["ur5e", "fr3"])


@BOTH
@pytest.mark.parametrize(
    ("low", "high", "milliseconds"), [(-0.3, 0.3, 24), (-0.1, 0.1, 8), (0.0, 0.2, 8), (-0.3, 0.3, 40)]
)
def test_a_velocity_that_changes_at_every_message_acts_as_its_mean(
    arm: ik.Arm, low: float, high: float, milliseconds: int
) -> None:
    cell = PerfectArm(arm)
    begun = cell.tool()[1, 3]
    for k in range(1200 // milliseconds):
        values = [0, (high, low)[k % 2], 0, 0, 0, 0]
        cell.ok("a", command="setVelocity", type="task", reference=1, data=values)
        cell.advance(milliseconds / 1000)
    cell.ok("a", command="setVelocity", type="task", reference=1, data=[0.0] * 6)  # else the last one lives for 100 ms
    cell.until_rest()
    moved, mean = cell.tool()[1, 3] - begun, 0.5 * (low + high)
    assert abs(moved - 1.2 * mean) < 0.02, f"moved {moved:.3f} m"
    cell.check_limits()


@pytest.mark.parametrize("speed", [0.3, 1.5])
def test_a_joint_velocity_that_alternates_about_zero_comes_to_nothing(speed: float) -> None:
    cell = PerfectArm()
    for k in range(80):
        cell.ok("a", command="setVelocity", type="joints", data=[speed * (-1) ** k, 0, 0, 0, 0, 0])
        cell.advance(0.016)
    cell.ok("a", command="setVelocity", type="joints", data=[0.0] * 6)
    cell.until_rest()
    assert abs(cell.q[0] - UR5E.home[0]) < 0.02 + 0.02 * speed
    cell.check_limits()


@pytest.mark.parametrize("elbow", [0.05, 0.3])
@pytest.mark.parametrize("back", [4, 10, 25])
def test_a_tool_that_turns_back_from_the_edge_of_reach_rests_on_its_line(elbow: float, back: int) -> None:
    cell = PerfectArm()
    cell.ok("a", command="appendPath", type="joints", data=[[0, -1.2, elbow, -1, -1.57, 0]])
    cell.until_rest()
    cell.history.clear()
    line = cell.tool()[:2, 3]
    for speed in [0.1] * 15 + [-0.1] * back:
        cell.ok("a", command="setVelocity", type="task", reference=1, data=[0, 0, speed, 0, 0, 0])
        cell.advance(0.04)
    cell.until_rest()
    off = np.array([np.linalg.norm(cell.tool(q)[:2, 3] - line) for q in cell.driven()[0]])
    assert off.max() < 2e-4
    cell.check_limits()
