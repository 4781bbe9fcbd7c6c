"""Not into itself or the station: paths are refused, velocities slow down, torques end before it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.schemas.arrays import Array
from rackhand.services.controller import ik
from rackhand.services.controller.ik.clearance import MARGIN
from tests.controller.cell import PerfectArm, pose
from tests.controller.station import CELLS

BOTH = pytest.mark.parametrize("kind", ["ur5e", "fr3"])
UR = CELLS["ur5e"]
OVER_TABLE = UR.home + np.pi * np.eye(6)[0]
DOWN = OVER_TABLE + 1.2 * np.eye(6)[1]


def turned(angle: float, *axis: float) -> dict[str, Any]:
    """A task path in place, about an axis of the tool."""
    unit = (np.array(axis) / np.linalg.norm(axis)).tolist()
    target = {"Position": [0, 0, 0], "Orientation": {"AngleAxis": {"Angle": angle, "Axis": unit}}}
    return {"type": "task", "method": 2, "reference": 2, "data": [target]}


def joint(number: int, by: float, arm: ik.Arm = UR) -> dict[str, Any]:
    return {"type": "joints", "data": [arm.home.tolist(), (arm.home + by * np.eye(arm.n)[number]).tolist()]}


def nearest(cell: PerfectArm) -> Array:
    """Of every tick so far, how near any two solids are."""
    clearance = ik.Clearance(cell.arm)
    return np.array([clearance.distances(q).min() for q in cell.driven()[0]])


@pytest.mark.parametrize(
    ("path", "point", "pair"),
    [
        (turned(np.pi, 0, 1, 0), 0, ("forearm", "wrist_3")),
        (joint(1, 2.0), 1, ("wrist_3", "pedestal")),
        (joint(1, -2.4), 1, ("upper_arm", "pedestal")),
        (joint(2, 1.55), 1, ("lift", "wrist_3")),
        ({"type": "joints", "data": [OVER_TABLE.tolist(), DOWN.tolist()]}, 1, ("wrist_3", "tote_table")),
    ],
)
def test_a_path_that_would_collide_is_refused_with_the_point_and_the_pair(
    path: dict[str, Any], point: int, pair: tuple[str, ...]
) -> None:
    cell = PerfectArm(UR)
    answer = cell.ask("a", command="appendPath", priority=10, **path)
    assert answer["message"] == {"code": 400, "detail": 0}
    assert answer["text"].startswith(f"waypoint {point}: ") and "before this point" in answer["text"]
    assert " and ".join(pair) in answer["text"]
    cell.advance(0.1)
    assert np.array_equal(cell.q, UR.home)


def test_what_is_appended_to_a_motion_is_checked_and_the_motion_goes_on() -> None:
    cell = PerfectArm(UR)
    cell.ok("a", command="appendPath", **joint(0, 0.5))
    cell.advance(0.3)
    answer = cell.ask("a", command="appendPath", priority=10, **joint(1, 2.0))
    assert answer["message"]["code"] == 400 and "waypoint 1: " in answer["text"]
    cell.until_rest()
    assert np.abs(cell.q - UR.home - 0.5 * np.eye(6)[0]).max() < 1e-9


def test_an_arm_that_is_near_something_may_leave_it() -> None:
    cell, clearance = PerfectArm(UR), ik.Clearance(UR)
    down = np.linspace(OVER_TABLE, DOWN, 2000)
    cell.controller.reset("moved by hand")
    cell.q = next(q for q in down if clearance.distances(q).min() < 2e-3)
    cell.tick()
    cell.advance(0.02)
    further = (cell.q + 0.02 * np.eye(6)[1]).tolist()
    assert cell.ask("a", command="appendPath", priority=10, type="joints", data=[further])["message"]["code"] == 400
    cell.ok("a", command="appendPath", type="joints", data=[UR.home.tolist()])


@pytest.mark.parametrize(("kind", "number", "sign"), [("ur5e", 1, 1), ("ur5e", 1, -1), ("ur5e", 2, 1), ("fr3", 1, 1)])
def test_a_joint_velocity_slows_down_before_it_touches(kind: str, number: int, sign: int) -> None:
    arm = CELLS[kind]
    cell, speed = PerfectArm(arm), sign * np.eye(arm.n)[number]
    for _ in range(60):
        cell.ok("a", command="setVelocity", type="joints", data=speed.tolist())
        cell.advance(0.048)
    clear = nearest(cell)
    assert clear.min() > MARGIN - 5e-4
    assert clear[-1] < MARGIN + 2e-3, "it goes as far as it can"
    assert 804 in cell.get_status()["controllerStatus"]
    cell.check_limits()
    where = cell.q.copy()
    cell.ok("a", command="setVelocity", type="joints", data=(-speed).tolist())
    cell.advance(0.2)
    assert (cell.q - where)[number] * sign < -0.01


@BOTH
def test_a_tool_velocity_stops_above_the_table_on_its_line(kind: str) -> None:
    arm = CELLS[kind]
    cell = PerfectArm(arm)
    start = ik.forward(arm, arm.home)
    if kind == "ur5e":
        cell.ok("a", command="appendPath", **joint(0, np.pi))
    else:
        start[:, 3] = (0.5, 0.0, 0.2)
        cell.ok("a", command="appendPath", type="task", method=1, reference=1, data=[pose(start)])
    cell.until_rest()
    cell.history.clear()
    line = cell.tool()[:, 3]
    for _ in range(60):
        cell.ok("a", command="setVelocity", type="task", reference=1, data=[0, 0, -0.25, 0, 0, 0])
        cell.advance(0.048)
    tools = np.array([cell.tool(q)[:, 3] for q in cell.driven()[0]])
    assert np.abs(tools[:, :2] - line[:2]).max() < 1e-3
    clear = nearest(cell)
    assert MARGIN - 5e-4 < clear.min() < MARGIN + 3e-3
    cell.check_limits()


def test_a_torque_ends_before_it_touches() -> None:
    cell = PerfectArm(UR)
    for _ in range(30):
        cell.ask("a", command="setTorque", priority=10, type="joints", data=[0, 3, 0, 0, 0, 0])
        cell.advance(0.04)
    assert nearest(cell).min() > 0.0
    assert 804 in cell.get_status()["controllerStatus"]
