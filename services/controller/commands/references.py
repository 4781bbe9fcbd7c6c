"""``setVelocity`` and ``setTorque``: end 100 ms after their last refresh (spec motion-controller §6.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import RobotConfiguration
from rackhand.services.controller.access.streams import StreamSample
from rackhand.services.controller.access.types import SECOND
from rackhand.services.controller.arm_control import ArmControl
from rackhand.services.controller.commands.checks import malformed_joint_vector, wrong_reference
from rackhand.services.controller.commands.spec import CommandSpec, GrantedCommand, OnArm, Result
from rackhand.services.controller.motion.signal import SignalReference


def _set_velocity(request: crf.SetVelocity, arm: ArmControl, granted: GrantedCommand) -> Result:
    if request.type == "task" and arm.connected and arm.stopped_by_singularity:
        return Result.failed(CrfCode.LowManipulability, "the arm is near a singularity")
    return _follow(request, arm, granted)


def _set_torque(request: crf.SetTorque, arm: ArmControl, granted: GrantedCommand) -> Result:
    return _follow(request, arm, granted)


def _follow(request: crf.SetVelocity | crf.SetTorque, arm: ArmControl, granted: GrantedCommand) -> Result:
    assert granted.decision.token is not None, "a granted control request has the holder's token"
    timeout = None if request.timeout is None else int(min(request.timeout, 1.0) * SECOND)
    sample = StreamSample(granted.decision.token, request.sequence, request.stamp, timeout)
    values = np.array(request.data)
    if request.type == "task" and request.reference == 2:
        rotation = arm.tool_pose().rotation
        values = np.concatenate([rotation @ values[:3], rotation @ values[3:]])
    reference = SignalReference("velocity" if isinstance(request, crf.SetVelocity) else "torque", request.type, values)
    return arm.follow(reference, sample, request.command)


def _check_velocity(request: crf.SetVelocity, arm: RobotConfiguration) -> str:
    limits = arm.joint_limits if request.type == "joints" else arm.task_limits
    return _check(request, limits.max_velocity)


def _check_torque(request: crf.SetTorque, arm: RobotConfiguration) -> str:
    # A wrench has no bound of its own: the joint torques that it takes are bounded when they are computed.
    return _check(request, arm.joint_limits.max_torque if request.type == "joints" else (math.inf,) * 6)


def _check(request: crf.SetVelocity | crf.SetTorque, bounds: Sequence[float]) -> str:
    if request.type == "task" and (wrong := wrong_reference(request.reference)):
        return wrong
    if request.timeout is not None and not (math.isfinite(request.timeout) and request.timeout > 0):
        return f"timeout {request.timeout} s, want more than 0"
    for i, (value, bound) in enumerate(zip(request.data, bounds, strict=True)):
        if not (math.isfinite(value) and abs(value) <= bound):
            return f"data[{i}] is {value:g}, at most ±{bound:g}"
    return ""


SPECS = (
    CommandSpec(
        crf.SetVelocity, OnArm(_set_velocity), moves=True, check=_check_velocity, malformed=malformed_joint_vector
    ),
    CommandSpec(crf.SetTorque, OnArm(_set_torque), moves=True, check=_check_torque, malformed=malformed_joint_vector),
)
