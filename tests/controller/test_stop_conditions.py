"""Codes 800 to 804 of the motion, and the stop conditions that heed them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import STREAM_INTERVALS
from tests.controller.cell import PERIOD_NS, UR5E, PerfectArm, moved, pose

CONDITIONS = {
    CrfCode.RealTimeViolation: "StopOnComputationTimeViolation",
    CrfCode.LowManipulability: "StopOnLowManipulability",
    CrfCode.EndEffectorToleranceViolation: "StopOnToleranceViolation",
}


def tune(cell: PerfectArm, **controller: Any) -> None:
    cell.ok("a", command="setParameters", data={"Controller": controller})


def sphere(cell: PerfectArm, *offset: float, radius: float = 0.08) -> dict[str, Any]:
    center = (cell.tool()[:, 3] + offset).tolist()
    return {"CollisionAvoidanceSphere": {"enable": True, "center": center, "radius": radius, "blend": 0.0}}


def provoke(cell: PerfectArm, code: CrfCode) -> None:
    """Motion of some seconds in which the code comes up, and that goes on after it."""
    match code:
        case CrfCode.RealTimeViolation:
            cell.ok("a", command="appendPath", type="joints", data=[(UR5E.home + 1.5).tolist()])
            cell.advance(0.4)
            cell.stamp += 3 * PERIOD_NS  # states that never came
            cell.q = cell.controller.motion.q.copy()
            cell.tick()
        case CrfCode.LowManipulability:
            start = UR5E.home.copy()
            start[4] = -0.3
            cell.ok("a", command="appendPath", type="joints", data=[start.tolist()])
            cell.until_rest()
            through = start.copy()
            through[4] = 0.3
            target = pose(cell.tool(through))
            cell.ok("a", command="appendPath", type="task", data=[target], method=2, reference=1)
        case CrfCode.EndEffectorToleranceViolation:
            tune(cell, ObjectiveFunctions=sphere(cell, 0.0, 0.3, 0.0))
            target = pose(moved(cell.tool(), 0.0, 0.6, 0.0))
            cell.ok("a", command="appendPath", type="task", data=[target], method=2, reference=1)


@pytest.mark.parametrize("heeded", [False, True])
@pytest.mark.parametrize(
    "code", [CrfCode.RealTimeViolation, CrfCode.LowManipulability, CrfCode.EndEffectorToleranceViolation]
)
def test_a_code_comes_up_and_stops_the_arm_if_it_is_to(code: CrfCode, heeded: bool) -> None:
    cell = PerfectArm()
    tune(cell, StopConditions={CONDITIONS[code]: heeded})
    provoke(cell, code)
    for _ in range(250):
        if code in cell.get_status()["controllerStatus"]:
            break
        cell.advance(0.02)
    assert code in cell.get_status()["controllerStatus"]
    cell.advance(0.6)
    assert (not cell.controller.motion.running) is heeded
    if heeded:
        where = cell.q.copy()
        cell.advance(1.0)
        assert np.array_equal(cell.q, where)
    assert cell.get_status()["controllerStatus"][0] == CrfCode.OK


def test_the_next_motion_begins_with_a_clean_status() -> None:
    cell = PerfectArm()
    provoke(cell, CrfCode.RealTimeViolation)
    cell.until_rest()
    assert CrfCode.RealTimeViolation in cell.get_status()["controllerStatus"]
    cell.ok("a", command="appendPath", type="joints", data=[UR5E.home.tolist()])
    assert cell.get_status()["controllerStatus"] == [CrfCode.OK]


@pytest.mark.parametrize(("missed", "goes_on"), [(STREAM_INTERVALS, False), (STREAM_INTERVALS + 1, True), (200, True)])
def test_a_path_goes_on_where_it_was_after_periods_in_which_the_driver_has_stopped_the_arm(
    missed: int, goes_on: bool
) -> None:
    """A few periods the driver bridges: the path is then where it would have been."""
    cell = PerfectArm()
    cell.ok("a", command="appendPath", type="joints", data=[(UR5E.home + 1.5).tolist()])
    cell.advance(0.6)
    before, speed = cell.controller.motion.q.copy(), cell.controller.motion.v.copy()
    cell.stamp += (missed + 1) * PERIOD_NS
    cell.tick()
    periods = (cell.controller.motion.q - before) / (speed * PERIOD_NS * 1e-9)
    assert periods == pytest.approx(1.0 if goes_on else 1.0 + missed, rel=0.02)
    cell.advance(2.5)
    assert cell.q == pytest.approx(UR5E.home + 1.5)
