"""The profile: at which velocities and accelerations paths are driven, within what the arm can do."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.schemas.motion import ConfiguredJointLimits, ConfiguredTaskLimits, ProfileParameters, RobotConfiguration
from rackhand.services.controller import ik
from rackhand.services.controller.motion.kinematics import ArmKinematics
from rackhand.services.controller.trajectory import queue
from rackhand.services.controller.trajectory.model import JointLimits, PathCheck, TaskLimits
from rackhand.services.controller.trajectory.stream import PathLimits
from rackhand.services.controller.trajectory.time_law import Smoothing
from rackhand.services.controller.trajectory.timing import Planning


@dataclass(frozen=True)
class MotionProfile:
    """Joint vectors (n,) rad/s and rad/s², task vectors (6,) m/s and rad/s, m/s² and rad/s²; linear before angular."""

    joint_velocity: Array
    joint_acceleration: Array
    task_velocity: Array
    task_acceleration: Array

    @classmethod
    def default(cls, arm: ik.Arm) -> MotionProfile:
        """Half of what the joints can do, and at the tool a quarter of what it is allowed."""
        limits = arm.limits
        return cls(
            0.5 * limits.velocity,
            0.5 * limits.acceleration,
            0.25 * _six(limits.task_velocity),
            0.25 * _six(limits.task_acceleration),
        )

    def bounded(self, arm: ik.Arm) -> MotionProfile:
        """No more than the arm's limits."""
        limits = arm.limits
        return replace(
            self,
            joint_velocity=np.minimum(self.joint_velocity, limits.velocity),
            joint_acceleration=np.minimum(self.joint_acceleration, limits.acceleration),
            task_velocity=np.minimum(self.task_velocity, _six(limits.task_velocity)),
            task_acceleration=np.minimum(self.task_acceleration, _six(limits.task_acceleration)),
        )


def hardware_limits(arm: ik.Arm) -> JointLimits:
    limits = arm.limits
    return JointLimits(limits.lower, limits.upper, limits.velocity, limits.acceleration, limits.jerk)


def path_arm(arm: ik.Arm, profile: MotionProfile, check: PathCheck | None = None) -> queue.PathArm:
    """What paths appended from now on are planned with: joint motion at the joint profile, task paths at both; and
    what else is asked about them."""
    joints = replace(hardware_limits(arm), velocity=profile.joint_velocity, acceleration=profile.joint_acceleration)
    task = TaskLimits(profile.task_velocity, profile.task_acceleration)
    planning = Planning(smoothing=Smoothing.for_limits(joints.acceleration, joints.jerk))
    return queue.PathArm(ArmKinematics(arm), PathLimits(joints), PathLimits(joints, task), planning, check=check)


def configuration(arm: ik.Arm, profile: MotionProfile, period_ns: int) -> RobotConfiguration:
    """The answer to ``getConfiguration``."""
    limits = arm.limits
    return RobotConfiguration(
        joint_space_degree_of_freedom=arm.n,
        controller_loop_time_ms=period_ns / 1e6,
        joint_limits=ConfiguredJointLimits(
            max_position=tuple(limits.upper.tolist()),
            min_position=tuple(limits.lower.tolist()),
            max_velocity=tuple(limits.velocity.tolist()),
            max_acceleration=tuple(limits.acceleration.tolist()),
            max_torque=tuple(limits.torque.tolist()),
        ),
        task_limits=ConfiguredTaskLimits(
            max_velocity=tuple(_six(limits.task_velocity).tolist()),
            max_acceleration=tuple(_six(limits.task_acceleration).tolist()),
        ),
        profile_parameters=ProfileParameters(
            joint_velocities=tuple(profile.joint_velocity.tolist()),
            joint_accelerations=tuple(profile.joint_acceleration.tolist()),
            task_velocity=tuple(profile.task_velocity.tolist()),
            task_acceleration=tuple(profile.task_acceleration.tolist()),
        ),
    )


def _six(pair: tuple[float, float]) -> Array:
    linear, angular = pair
    return np.array([linear] * 3 + [angular] * 3)
