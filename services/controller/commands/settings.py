"""Commands that set something without a motion of their own: profiles, parameters, the gripper, control loops."""

from __future__ import annotations

import math

import numpy as np
from pydantic import ValidationError

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.codec import explain
from rackhand.schemas.crf_parameters import Parameters
from rackhand.schemas.motion import RobotConfiguration
from rackhand.services.controller.arm_control import ArmControl
from rackhand.services.controller.commands.spec import CommandSpec, GrantedCommand, OnArm, Result
from rackhand.services.controller.motion.parameters import ParametersRefused

SLOWEST_PROFILE, GENTLEST_PROFILE = 0.001, 0.01
"""Least profile velocity and acceleration, as shares of the arm's limits. Soft stops brake at the profile's
acceleration, so a profile near zero would be a stop that never ends."""


def parameters_of(request: crf.SetParameters) -> Parameters:
    """The typed content. Raises pydantic's ``ValidationError``, but not for what the check has passed."""
    return Parameters.model_validate(request.data, by_alias=True, by_name=False)


def _set_profile_velocity(request: crf.SetProfileVelocity, arm: ArmControl, _granted: GrantedCommand) -> Result:
    return _bounded(arm.set_profile(_field(request, "velocity"), np.array(request.data)), request.data)


def _set_profile_acceleration(request: crf.SetProfileAcceleration, arm: ArmControl, _granted: GrantedCommand) -> Result:
    return _bounded(arm.set_profile(_field(request, "acceleration"), np.array(request.data)), request.data)


def _field(request: crf.SetProfileVelocity | crf.SetProfileAcceleration, what: str) -> str:
    return f"{'joint' if request.type == 'joints' else 'task'}_{what}"


def _bounded(used: np.ndarray, wanted: tuple[float, ...]) -> Result:
    return Result.done(f"bounded by the arm's limits: {used.tolist()}" if (used < wanted).any() else "")


def _check_profile_velocity(request: crf.SetProfileVelocity, arm: RobotConfiguration) -> str:
    limits = arm.joint_limits if request.type == "joints" else arm.task_limits
    return _check_profile(request, arm, limits.max_velocity, SLOWEST_PROFILE)


def _check_profile_acceleration(request: crf.SetProfileAcceleration, arm: RobotConfiguration) -> str:
    limits = arm.joint_limits if request.type == "joints" else arm.task_limits
    return _check_profile(request, arm, limits.max_acceleration, GENTLEST_PROFILE)


def _check_profile(
    request: crf.SetProfileVelocity | crf.SetProfileAcceleration,
    arm: RobotConfiguration,
    bounds: tuple[float, ...],
    share: float,
) -> str:
    wanted = arm.joint_space_degree_of_freedom if request.type == "joints" else 6
    if len(request.data) != wanted:
        return f"data has {len(request.data)} numbers, want {wanted}"
    for i, (value, bound) in enumerate(zip(request.data, bounds, strict=True)):
        if not share * bound <= value < math.inf:
            return f"data[{i}] is {value:g}, want at least {share * bound:g} ({share:.1%} of the arm's limit)"
    return ""


def _set_parameters(request: crf.SetParameters, arm: ArmControl, _granted: GrantedCommand) -> Result:
    try:
        arm.motion.tuning.apply(parameters_of(request).controller)
    except ParametersRefused as refused:
        return Result.failed(refused.code, str(refused))
    return Result.done()


def _check_parameters(request: crf.SetParameters, arm: RobotConfiguration) -> str:
    try:
        controller = parameters_of(request).controller
    except ValidationError as problem:
        return explain(problem)
    joints = arm.joint_space_degree_of_freedom
    attraction = controller.desired_joint_position
    for name, vector in (
        ("DesiredJointPosition.AttractionPosition", attraction.attraction_position if attraction else None),
        ("UpdateJointsInitialPosition", controller.update_joints_initial_position),
    ):
        if vector is not None and len(vector) != joints:
            return f"Controller.{name} has {len(vector)} numbers, the arm {joints} joints"
    if attraction and any(math.isinf(q) for q in attraction.attraction_position):
        return "Controller.DesiredJointPosition.AttractionPosition: want finite numbers or NaN"
    return ""


def _set_gripper(request: crf.SetGripper, arm: ArmControl, _granted: GrantedCommand) -> Result:
    return arm.set_suction(request.suction)


def _start_control(
    _request: crf.StartJointsControl | crf.StartTaskControl, arm: ArmControl, _granted: GrantedCommand
) -> Result:
    return arm.start_control_loop()


SPECS = (
    CommandSpec(crf.SetProfileVelocity, OnArm(_set_profile_velocity), audited=True, check=_check_profile_velocity),
    CommandSpec(
        crf.SetProfileAcceleration,
        OnArm(_set_profile_acceleration),
        audited=True,
        check=_check_profile_acceleration,
    ),
    CommandSpec(crf.SetParameters, OnArm(_set_parameters), audited=True, check=_check_parameters),
    CommandSpec(crf.SetGripper, OnArm(_set_gripper), audited=True),
    CommandSpec(crf.StartJointsControl, OnArm(_start_control), moves=True),
    CommandSpec(crf.StartTaskControl, OnArm(_start_control), moves=True),
)
