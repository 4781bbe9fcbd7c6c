"""Joint torques of a reference, and when the arm has to brake instead."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik import Arm
from rackhand.services.controller.motion.kinematics import ArmKinematics
from rackhand.services.controller.motion.signal import SignalReference
from rackhand.services.controller.motion.torque import joint_torques, must_brake
from tests.controller.cell import FR3, UR5E

KINEMATICS = {arm.name: ArmKinematics(arm) for arm in (UR5E, FR3)}


def test_joint_torques_are_passed_on() -> None:
    reference = SignalReference("torque", "joints", np.arange(6.0))
    assert np.array_equal(joint_torques(UR5E, KINEMATICS["ur5e"], reference, UR5E.home), np.arange(6.0))


@pytest.mark.parametrize("arm", [UR5E, FR3], ids=["ur5e", "fr3"])
def test_the_torques_of_a_wrench_do_the_work_of_the_wrench(arm: Arm) -> None:
    """Virtual work, with pinocchio's forward kinematics: τ·dq = w·dx."""
    wrench = np.array([3.0, -2.0, 5.0, 0.4, -0.3, 0.2])
    torque = joint_torques(arm, KINEMATICS[arm.name], SignalReference("torque", "task", wrench), arm.home)
    frame, data = arm.model.getFrameId("flange"), arm.model.createData()
    for joint in range(arm.n):
        poses = []
        for step in (-1e-6, 1e-6):
            q = arm.home.copy()
            q[joint] += step
            pin.framesForwardKinematics(arm.model, data, q)
            poses.append(data.oMf[frame].copy())
        moved = (poses[1].translation - poses[0].translation) / 2e-6
        turned = pin.log3(poses[1].rotation @ poses[0].rotation.T) / 2e-6
        assert torque[joint] == pytest.approx(wrench[:3] @ moved + wrench[3:] @ turned, abs=1e-6)


def test_a_wrench_beyond_the_torque_limits_keeps_its_direction() -> None:
    wrench = np.array([0.0, 0.0, 20.0, 0.0, 0.0, 0.0])
    small = joint_torques(UR5E, KINEMATICS["ur5e"], SignalReference("torque", "task", wrench), UR5E.home)
    large = joint_torques(UR5E, KINEMATICS["ur5e"], SignalReference("torque", "task", 1e4 * wrench), UR5E.home)
    assert (np.abs(large) / UR5E.limits.torque).max() == pytest.approx(1.0)
    assert np.allclose(large / np.linalg.norm(large), small / np.linalg.norm(small))


def test_the_arm_brakes_before_a_velocity_or_position_limit() -> None:
    limits, still, period = UR5E.limits, np.zeros(6), 0.004

    def brakes(q: Array, v: Array, gained: Array = still) -> bool:
        return must_brake(UR5E, q, v, gained, period)

    assert not brakes(UR5E.home, still)
    assert not brakes(UR5E.home, 0.9 * limits.velocity)
    assert brakes(UR5E.home, 1.01 * limits.velocity)
    assert brakes(UR5E.home, 0.99 * limits.velocity, 0.01 * limits.velocity), "too fast before the stop acts"
    near = limits.upper - 0.05
    slow = np.sqrt(2 * 0.04 * limits.acceleration)
    assert not brakes(near, 0.8 * slow)
    assert brakes(near, 1.3 * slow)
    assert brakes(near, 0.8 * slow, 0.2 * slow), "what it gains meanwhile must be braked too"
    assert not brakes(near, -0.8 * slow), "away from the end of the range"
