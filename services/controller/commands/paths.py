"""``appendPath``: waypoints of the joints or of the tool, appended to what is queued (spec motion-controller §6.3).

Reachability is not checked before control is taken: that takes kinematics, and planning refuses what is out of reach.
"""

from __future__ import annotations

import math

import numpy as np

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.motion import RobotConfiguration
from rackhand.services.controller.arm_control import ArmControl
from rackhand.services.controller.commands.checks import wrong_reference
from rackhand.services.controller.commands.spec import CommandSpec, GrantedCommand, OnArm, Result
from rackhand.services.controller.trajectory.model import Placement, TcpPose
from rackhand.services.controller.trajectory.queue import Method, MotionQueue, ReferenceFrame

FARTHEST = 100.0
"""Metres. Far beyond any arm's reach, and near enough that a double still resolves micrometres there."""


def _append_joints(request: crf.AppendJointsPath, arm: ArmControl, granted: GrantedCommand) -> Result | None:
    def append(queue: MotionQueue, t: float) -> MotionQueue:
        return queue.append_joints(t, [np.array(point) for point in request.data])

    return arm.append("joints", append, len(request.data), granted)


def _append_task(request: crf.AppendTaskPath, arm: ArmControl, granted: GrantedCommand) -> Result | None:
    method, reference = Method(request.method), ReferenceFrame(request.reference)
    tcp: Placement = arm.tool_pose()  # at the call: reference 2 refers to it

    def append(queue: MotionQueue, t: float) -> MotionQueue:
        points = [TcpPose(np.array(pose.position), pose.orientation.rotation()) for pose in request.data]
        return queue.append_task(t, points, method, reference, tcp)

    return arm.append("task", append, len(request.data), granted)


def _check_joints(request: crf.AppendJointsPath, arm: RobotConfiguration) -> str:
    if not request.data:
        return "data is empty, want at least one point"
    joints, limits = arm.joint_space_degree_of_freedom, arm.joint_limits
    for i, point in enumerate(request.data):
        if len(point) != joints:
            return f"data[{i}] has {len(point)} numbers, the arm {joints} joints"
        for j, (q, low, high) in enumerate(zip(point, limits.min_position, limits.max_position, strict=True)):
            if not (math.isfinite(q) and low <= q <= high):
                return f"data[{i}][{j}] is {q:g} rad, outside [{low:g}, {high:g}]"
    return ""


def _check_task(request: crf.AppendTaskPath, _arm: RobotConfiguration) -> str:
    if not request.data:
        return "data is empty, want at least one pose"
    if request.method not in (1, 2):
        return f"method {request.method}, want 1 (joint space) or 2 (task space)"
    for i, pose in enumerate(request.data):
        if not pose.finite:
            return f"data[{i}] holds a number that is not finite"
        if (far := max(map(abs, pose.position))) > FARTHEST:
            return f"data[{i}] is {far:g} m from the base, beyond the reach of any arm"
    return wrong_reference(request.reference)


SPECS = (
    CommandSpec(crf.AppendJointsPath, OnArm(_append_joints), moves=True, once=True, check=_check_joints),
    CommandSpec(crf.AppendTaskPath, OnArm(_append_task), moves=True, once=True, check=_check_task),
)
