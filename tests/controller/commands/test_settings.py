"""Profiles at the ends of what they may be: what is slowest is driven, what is less is refused."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.schemas.arrays import Array
from rackhand.services.controller.commands.settings import GENTLEST_PROFILE, SLOWEST_PROFILE
from tests.controller.cell import UR5E, PerfectArm

JOINT = ("joints", UR5E.limits.velocity, UR5E.limits.acceleration)
TASK = (
    "task",
    np.repeat(UR5E.limits.task_velocity, 3),
    np.repeat(UR5E.limits.task_acceleration, 3),
)
EITHER = pytest.mark.parametrize(("kind", "velocity", "acceleration"), [JOINT, TASK], ids=["joints", "task"])


def set_profile(cell: PerfectArm, kind: str, velocity: Array, acceleration: Array) -> list[int]:
    both = (("setProfileVelocity", velocity), ("setProfileAcceleration", acceleration))
    answers = (cell.ask("a", command=name, priority=10, type=kind, data=data.tolist()) for name, data in both)
    return [answer["message"]["code"] for answer in answers]


def drive(cell: PerfectArm, kind: str, size: float) -> float:
    """Seconds for a path of ``size`` [rad or m]."""
    if kind == "joints":
        data = [(UR5E.home + size * np.eye(6)[0]).tolist()]
        cell.ok("a", command="appendPath", type="joints", data=data)
    else:
        pose = {"Position": [0, 0, size], "Orientation": {"Quaternion": {"W": 1, "X": 0, "Y": 0, "Z": 0}}}
        cell.ok("a", command="appendPath", type="task", method=2, reference=2, data=[pose])
    return cell.until_rest(120.0)


@EITHER
def test_the_slowest_profile_is_driven_and_stopped(kind: str, velocity: Array, acceleration: Array) -> None:
    cell = PerfectArm()
    slowest = SLOWEST_PROFILE * velocity
    assert set_profile(cell, kind, slowest, GENTLEST_PROFILE * acceleration) == [200, 200]
    size = 2.0 * float(slowest[2])
    took = drive(cell, kind, size)
    assert 2.0 <= took < 3.5, "at that speed, and what it takes to speed up and to brake"
    cell.check_limits()


@EITHER
def test_the_fastest_profile_is_that_of_the_arm_and_more_is_bounded_by_it(
    kind: str, velocity: Array, acceleration: Array
) -> None:
    times = []
    for factor in (1.0, 10.0):
        cell = PerfectArm()
        assert set_profile(cell, kind, factor * velocity, factor * acceleration) == [200, 200]
        times.append(drive(cell, kind, 0.05))
        cell.check_limits()
    assert times[0] == pytest.approx(times[1])


@EITHER
def test_less_than_the_slowest_is_refused_and_changes_nothing(kind: str, velocity: Array, acceleration: Array) -> None:
    cell = PerfectArm()
    before = cell.controller.motion.profile
    for factor in (0.999, 0.0, -1.0):
        codes = set_profile(cell, kind, factor * SLOWEST_PROFILE * velocity, factor * GENTLEST_PROFILE * acceleration)
        assert codes == [400, 400]
    assert cell.controller.motion.profile is before
