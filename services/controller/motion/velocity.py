"""Following a velocity reference: a ramp to it, within the limits of the joints, on the line of a tool velocity."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.schemas.crf import CrfCode
from rackhand.services.controller import ik
from rackhand.services.controller.motion.kinematics import ArmKinematics
from rackhand.services.controller.motion.metered_solver import MeteredSolver
from rackhand.services.controller.motion.profile import MotionProfile
from rackhand.services.controller.motion.ramp import Ramp, Reference
from rackhand.services.controller.trajectory.continuation import pose_error
from rackhand.services.controller.trajectory.model import TcpPose

_DAMPING = 1e-6  # of the pseudo-inverse that tells the joints' velocities
_BLOCKED = (CrfCode.WorkspaceViolation,)
_TASK_JERK_TIME = 0.05  # seconds in which a task velocity's acceleration may build up
_MAX_TRACKING_LAG = np.array([2e-4] * 3 + [1e-3] * 3)
"""m, rad: how far a tool that cannot follow may stay behind its target."""


class VelocityFollower(Protocol):
    """Follows one reference from rest until it is over."""

    ramped: Array
    """The reference after the ramp, as it was followed last."""

    def step(self, values: Array, q: Array, v: Array, profile: MotionProfile) -> tuple[Array, tuple[CrfCode, ...]]:
        """The joint velocity (n,) [rad/s] of the coming period towards the reference ``values``, from commanded ``q``
        and ``v`` (n,); and the codes that hold."""


class JointVelocity:
    """``values`` (n,) in rad/s."""

    def __init__(self, arm: ik.Arm, clearance: ik.Clearance, period: float) -> None:
        self._arm, self._clearance, self._period = arm, clearance, period
        self._reference, self._ramp = Reference(arm.n, period), Ramp(arm.n)
        self.ramped = np.zeros(arm.n)

    def step(self, values: Array, q: Array, v: Array, profile: MotionProfile) -> tuple[Array, tuple[CrfCode, ...]]:
        acceleration = np.minimum(profile.joint_acceleration, self._arm.limits.acceleration)
        wanted = self._ramp.step(self._reference.step(values), acceleration, self._arm.limits.jerk, self._period)
        share = self._clearance.speed_share(q, wanted, self._period)
        self.ramped = self._ramp.slow(share)
        lower, upper = ik.velocity_box(self._arm, q, v, self._period)
        velocity = np.clip(self.ramped, lower, upper)
        self._ramp.cut(velocity)
        return velocity, _BLOCKED if share < 1.0 else ()


class TaskVelocity:
    """``values`` (6,): the tool's twist in base axes, m/s and rad/s.

    A target moves with the ramped twist, scaled by ``DifferentialIk.twist_scale`` and so that the arm stays clear of
    itself and its station, and the tool follows the target.
    """

    def __init__(self, arm: ik.Arm, solver: MeteredSolver, clearance: ik.Clearance, period: float, q: Array) -> None:
        self._kinematics, self._solver, self._period = ArmKinematics(arm), solver, period
        self._clearance = clearance
        self._reference, self._ramp = Reference(6, period), Ramp(6)
        self._target = ik.forward(arm, q)
        self.ramped = np.zeros(6)

    def step(self, values: Array, q: Array, v: Array, profile: MotionProfile) -> tuple[Array, tuple[CrfCode, ...]]:
        acceleration = profile.task_acceleration
        jerk = acceleration / _TASK_JERK_TIME
        twist = self._ramp.step(self._reference.step(values), acceleration, jerk, self._period)
        twist = self._ramp.slow(self._solver.ik.twist_scale(q, v, twist))
        twist = self._ramp.slow(self._allowed_share(q, twist))
        share = self._clearance.speed_share(q, self._joint_velocity(q, twist), self._period)
        self.ramped = twist = self._ramp.slow(share)
        step = self._solver.step(q, v, self._target, twist, held=True)
        self._target = _advanced(self._target, twist * self._period)
        return step.velocity, step.codes if share == 1.0 else tuple({*step.codes, *_BLOCKED})

    def _joint_velocity(self, q: Array, twist: Array) -> Array:
        """(n,) that moves the tool with ``twist``, slower at singularities."""
        jacobian = self._kinematics.jacobian(q)
        gram = jacobian @ jacobian.T
        gram[np.diag_indices(6)] += _DAMPING
        return np.asarray(jacobian.T @ np.linalg.solve(gram, twist))

    def _allowed_share(self, q: Array, twist: Array) -> float:
        """The share 0 … 1 of ``twist`` that the target may make: less the farther the tool is behind. At limits and
        singularities the target waits, and turning back is followed at once."""
        target = TcpPose(self._target[:, 3], self._target[:, :3])
        behind = pose_error(self._kinematics.forward(q), target) / _MAX_TRACKING_LAG
        if behind @ (twist / _MAX_TRACKING_LAG) <= 0:
            return 1.0
        return max(0.0, 1.0 - float(np.linalg.norm(behind)))


def _advanced(pose: Array, step: Array) -> Array:
    """``pose`` (3, 4) after the displacement ``step`` (6,) [m, rad], in base axes at the tool (Rodrigues' formula)."""
    angle = float(np.linalg.norm(step[3:]))
    x, y, z = step[3:] / max(angle, 1e-12)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
    return np.column_stack([turn @ pose[:, :3], pose[:, 3] + step[:3]])
