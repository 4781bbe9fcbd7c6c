"""The content of ``getStatus``: measured signals, and the codes raised since the last motion began."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.crf_contact import Contact
from rackhand.schemas.crf_requests import CrfVector
from rackhand.schemas.motion import ArmState, Expected, MotionStatus
from rackhand.schemas.orientation import CrfVec6, Orientation, TaskPose
from rackhand.services.controller.motion.kinematics import ArmKinematics

_UNMEASURED = CrfCode.MethodNotAllowed


class StatusCodes:
    """CRF's ``controllerStatus``: a set that is cleared when a motion begins and grows until the next one."""

    def __init__(self) -> None:
        self._codes = {int(CrfCode.OK)}

    def begin(self) -> None:
        self._codes = {int(CrfCode.OK)}

    def add(self, codes: Iterable[CrfCode]) -> None:
        self._codes.update(int(code) for code in codes)

    @property
    def ascending(self) -> tuple[int, ...]:
        return tuple(sorted(self._codes))


class Observer:
    """Computes signals from arm states, when a status is asked for. Accelerations are differences of measured
    velocities, so the second state is the first to have one."""

    def __init__(self, kinematics: ArmKinematics) -> None:
        self._kinematics = kinematics
        self._before: ArmState | None = None
        self.state: ArmState | None = None

    def see(self, state: ArmState) -> None:
        """At every tick, so that nothing is computed here."""
        if self.state is not None and state.stamp > self.state.stamp:
            self._before = self.state
        self.state = state

    def _twist(self, state: ArmState) -> Array:
        return np.asarray(self._kinematics.jacobian(np.array(state.q)) @ np.array(state.dq))

    def _rates(self, state: ArmState, twist: Array) -> tuple[Array | None, Array | None]:
        """Joint and task acceleration."""
        before = self._before
        if before is None or before.stamp >= state.stamp:
            return None, None
        dt = (state.stamp - before.stamp) * 1e-9
        return (np.array(state.dq) - np.array(before.dq)) / dt, (twist - self._twist(before)) / dt

    def status(self, codes: tuple[int, ...], running: bool, contact: Contact | None = None) -> MotionStatus:
        """Without the fields of priority access (``Dispatcher.complete`` adds it)."""
        state = self.state
        if state is None:
            missing = CrfCode.NotInitialized
            return MotionStatus(
                status="deinitialize",
                priority_under_control=0,
                is_trajectory_running=Expected[bool].of(False),
                controller_status=codes,
                joint_positions=Expected[CrfVector].failed(missing),
                joint_velocities=Expected[CrfVector].failed(missing),
                joint_accelerations=Expected[CrfVector].failed(missing),
                joint_force_torques=Expected[CrfVector].failed(missing),
                task_pose=Expected[TaskPose].failed(missing),
                task_velocity=Expected[CrfVec6].failed(missing),
                task_acceleration=Expected[CrfVec6].failed(missing),
                task_force_torque=Expected[CrfVec6].failed(missing),
            )
        pose = self._kinematics.forward(np.array(state.q))
        wrench = np.concatenate([pose.rotation @ state.wrench[:3], pose.rotation @ state.wrench[3:]])
        twist = self._twist(state)
        ddq, acceleration = self._rates(state, twist)
        return MotionStatus(
            status="initialize",
            priority_under_control=0,
            is_trajectory_running=Expected[bool].of(running),
            controller_status=codes,
            joint_positions=Expected[CrfVector].of(state.q),
            joint_velocities=Expected[CrfVector].of(state.dq),
            joint_accelerations=_joints(ddq),
            joint_force_torques=Expected[CrfVector].of(state.efforts),
            task_pose=Expected[TaskPose].of(
                TaskPose(position=_three(pose.translation), orientation=Orientation.of(pose.rotation))
            ),
            task_velocity=Expected[CrfVec6].of(_six(twist)),
            task_acceleration=_task(acceleration),
            task_force_torque=Expected[CrfVec6].of(_six(wrench)),
            stamp=state.stamp,
            gripper=state.gripper,
            contact=contact,
        )


def _joints(values: Array | None) -> Expected[CrfVector]:
    if values is None:
        return Expected[CrfVector].failed(_UNMEASURED)
    return Expected[CrfVector].of(tuple(values.tolist()))


def _task(values: Array | None) -> Expected[CrfVec6]:
    return Expected[CrfVec6].failed(_UNMEASURED) if values is None else Expected[CrfVec6].of(_six(values))


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _six(values: Array) -> tuple[float, float, float, float, float, float]:
    a, b, c, d, e, f = values.tolist()
    return a, b, c, d, e, f
