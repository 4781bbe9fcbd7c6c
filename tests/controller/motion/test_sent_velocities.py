"""A tool velocity that is turned round at the edge of reach, where the joints are fast and the tool is slow."""

from __future__ import annotations

import numpy as np

from tests.controller.cell import PerfectArm


def test_a_tool_that_turns_back_from_the_edge_of_reach_rests_on_its_line() -> None:
    cell = PerfectArm()
    cell.ok("a", command="appendPath", type="joints", data=[[0, -1.2, 0.05, -1, -1.57, 0]])
    cell.until_rest()
    cell.history.clear()
    line = cell.tool()[:2, 3]
    for speed in [0.1] * 25 + [-0.1] * 10:
        cell.ok("a", command="setVelocity", type="task", reference=1, data=[0, 0, speed, 0, 0, 0])
        cell.advance(0.04)
    cell.until_rest()
    off = np.array([np.linalg.norm(cell.tool(q)[:2, 3] - line) for q in cell.driven()[0]])
    assert off.max() < 1e-3
    cell.check_limits()
