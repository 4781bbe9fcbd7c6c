"""What is well formed and still cannot be done: values outside the arm's limits (an ``expected`` with 400).

Reachability is not judged here: that takes kinematics, and the controller has the last word on an admitted command.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pydantic import ValidationError

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.codec import explain
from rackhand.schemas.motion import Parameters, RobotConfiguration

SLOWEST_PROFILE, GENTLEST_PROFILE = 0.001, 0.01
"""Least profile velocity and acceleration, of the arm's limits. Stops brake at the profile: they must end."""
FARTHEST = 100.0
"""Metres. Way beyond reach, and so near that a double still tells micrometres there."""


def objection(request: crf.Request, arm: RobotConfiguration) -> str:
    """Why the arm cannot do it: what, where, by how much. Empty, nothing speaks against it."""
    match request:
        case crf.AppendJointsPath():
            return _joints_path(request.data, arm)
        case crf.AppendTaskPath():
            return _task_path(request)
        case crf.SetVelocity() | crf.SetTorque():
            return _stream(request, arm)
        case crf.SetProfileVelocity() | crf.SetProfileAcceleration():
            return _profile(request, arm)
        case crf.SetParameters():
            return _parameters(request, arm)
    return ""


def parameters_of(request: crf.SetParameters) -> Parameters:
    """The typed content; raises pydantic's ``ValidationError``, after ``objection`` has passed never."""
    return Parameters.model_validate(request.data, by_alias=True, by_name=False)


def _joints_path(points: Sequence[Sequence[float]], arm: RobotConfiguration) -> str:
    if not points:
        return "data is empty, want at least one point"
    joints, limits = arm.joint_space_degree_of_freedom, arm.joint_limits
    for i, point in enumerate(points):
        if len(point) != joints:
            return f"data[{i}] has {len(point)} numbers, the arm {joints} joints"
        for j, (q, low, high) in enumerate(zip(point, limits.min_position, limits.max_position, strict=True)):
            if not (math.isfinite(q) and low <= q <= high):
                return f"data[{i}][{j}] is {q:g} rad, outside [{low:g}, {high:g}]"
    return ""


def _task_path(request: crf.AppendTaskPath) -> str:
    if not request.data:
        return "data is empty, want at least one pose"
    if request.method not in (1, 2):
        return f"method {request.method}, want 1 (joint space) or 2 (task space)"
    for i, pose in enumerate(request.data):
        if not pose.finite:
            return f"data[{i}] holds a number that is not finite"
        if (far := max(map(abs, pose.position))) > FARTHEST:
            return f"data[{i}] is {far:g} m away, beyond any arm's reach"
    return _reference(request.reference)


def _stream(request: crf.SetVelocity | crf.SetTorque, arm: RobotConfiguration) -> str:
    if request.type == "task" and (wrong := _reference(request.reference)):
        return wrong
    if request.timeout is not None and not (math.isfinite(request.timeout) and request.timeout > 0):
        return f"timeout {request.timeout} s, want more than 0"
    bounds: Sequence[float]
    if isinstance(request, crf.SetVelocity):
        bounds = arm.joint_limits.max_velocity if request.type == "joints" else arm.task_limits.max_velocity
    else:
        # A force at the TCP has no bound of its own: the joints' torques are bounded where they are known.
        bounds = arm.joint_limits.max_torque if request.type == "joints" else (math.inf,) * 6
    for i, (value, bound) in enumerate(zip(request.data, bounds, strict=True)):
        if not (math.isfinite(value) and abs(value) <= bound):
            return f"data[{i}] is {value:g}, at most ±{bound:g}"
    return ""


def _profile(request: crf.SetProfileVelocity | crf.SetProfileAcceleration, arm: RobotConfiguration) -> str:
    wanted = arm.joint_space_degree_of_freedom if request.type == "joints" else 6
    if len(request.data) != wanted:
        return f"data has {len(request.data)} numbers, want {wanted}"
    limits = arm.joint_limits if request.type == "joints" else arm.task_limits
    velocity = isinstance(request, crf.SetProfileVelocity)
    bounds = limits.max_velocity if velocity else limits.max_acceleration
    share = SLOWEST_PROFILE if velocity else GENTLEST_PROFILE
    for i, (value, bound) in enumerate(zip(request.data, bounds, strict=True)):
        if not share * bound <= value < math.inf:
            return f"data[{i}] is {value:g}, want at least {share * bound:g} ({share:.1%} of the arm's limit)"
    return ""


def _parameters(request: crf.SetParameters, arm: RobotConfiguration) -> str:
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


def _reference(reference: int | None) -> str:
    return "" if reference in (1, 2) else f"reference {reference}, want 1 (robot base) or 2 (TCP)"
