"""A task velocity held where the arm cannot follow: the tool stays on its line, waits, and turns back at once."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.schemas.arrays import Array
from rackhand.services.controller import ik
from tests.controller.cell import FR3, PERIOD_NS, UR5E, PerfectArm

OUT = {
    arm.name: ik.forward(arm, arm.home)[:, 3] / np.linalg.norm(ik.forward(arm, arm.home)[:, 3]) for arm in (UR5E, FR3)
}
SPEED = 0.25


def hold(cell: PerfectArm, direction: Array, seconds: float, speed: float = SPEED) -> None:
    for _ in range(round(seconds / 0.04)):
        data = [*(speed * direction).tolist(), 0.0, 0.0, 0.0]
        cell.ok("a", command="setVelocity", type="task", data=data, reference=1)
        cell.advance(0.04)


def off_line(cell: PerfectArm, start: Array, direction: Array, first: int = 0) -> tuple[Array, Array, Array]:
    """Of every tick from ``first`` on: m along the line, m off it, degrees turned."""
    tools = np.array([cell.tool(q) for q in cell.driven()[0][first:]])
    away = tools[:, :, 3] - start[:, 3]
    along = away @ direction
    traces = np.einsum("ij,kij->k", start[:, :3], tools[:, :, :3])
    turned = np.degrees(np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0)))
    return along, np.linalg.norm(away - along[:, None] * direction, axis=1), turned


def flips(dq: Array, arm: ik.Arm) -> int:
    """How often a joint's acceleration changes sign, at a fifth of its limit or more on both sides: what chatter is."""
    rate = np.diff(dq, axis=0) / (PERIOD_NS * 1e-9) / arm.limits.acceleration
    before, after = rate[:-1], rate[1:]
    return int(np.sum((before * after < 0) & (np.abs(before) > 0.2) & (np.abs(after) > 0.2)))


@pytest.mark.parametrize("line", ["outwards", "up", "sideways", "aslant"])
@pytest.mark.parametrize("arm", [UR5E, FR3], ids=["ur5e", "fr3"])
def test_held_into_the_edge_of_reach_the_tool_keeps_its_line_and_turns_back_at_once(arm: ik.Arm, line: str) -> None:
    ways = {"outwards": OUT[arm.name], "up": [0, 0, 1.0], "sideways": [0, 1.0, 0], "aslant": [0.65, 0.65, 0.39]}
    direction = np.array(ways[line]) / np.linalg.norm(ways[line])
    cell = PerfectArm(arm)
    start = cell.tool()
    hold(cell, direction, 5.0)
    along, off, turned = off_line(cell, start, direction)
    _, dq = cell.driven()
    reached = along[-1]
    assert reached > 0.2
    assert off.max() < 5e-4
    assert turned.max() < 0.05
    assert flips(dq, arm) <= 10
    assert np.abs(along[-50:] - reached).max() < 1e-3, "it waits there"
    hold(cell, -direction, 0.48)
    back, off, _ = off_line(cell, start, direction, len(dq))
    assert back.max() < reached + 5e-4
    assert back[-1] < reached - 1e-3
    assert off.max() < 5e-4
    cell.check_limits()


def test_fast_turns_of_a_redundant_arm_at_the_ends_of_its_joints_stay_about_their_axis() -> None:
    """Joints that come to the end of their range hand over to others, at a speed that these can take up."""
    cell = PerfectArm(FR3)
    start = cell.tool()
    for _ in range(100):
        cell.ok("a", command="setVelocity", type="task", data=[0, 0, 0, 0, 1.0, 0], reference=1)
        cell.advance(0.04)
    moved = np.array([cell.tool(q)[:, 3] for q in cell.driven()[0]]) - start[:, 3]
    assert np.linalg.norm(moved, axis=1).max() < 5e-4
    room = np.minimum(cell.q - FR3.limits.lower, FR3.limits.upper - cell.q)
    assert room.min() < 0.02, "a joint is at its end"
    cell.check_limits()


@pytest.mark.parametrize("arm", [UR5E, FR3], ids=["ur5e", "fr3"])
def test_the_scale_is_1_in_the_open_and_falls_towards_the_edge(arm: ik.Arm) -> None:
    """Near the edge as the braking of a fold has it: with the power 3/4 of the distance."""
    solver = ik.DifferentialIk(arm, 0.004)
    direction = OUT[arm.name]
    assert solver.twist_scale(arm.home, np.zeros(arm.n), np.array([*(0.002 * direction), 0, 0, 0])) == 1.0
    cell = PerfectArm(arm)
    start = cell.tool()
    hold(cell, direction, 5.0)
    along, _, _ = off_line(cell, start, direction)
    left = along.max() - along
    speed = np.diff(along) / (PERIOD_NS * 1e-9)
    near = np.flatnonzero((left[:-1] > 2e-3) & (left[:-1] < 1e-2))
    power = np.polyfit(np.log(left[near]), np.log(speed[near]), 1)[0]
    assert 0.65 < power < 0.85
