"""Kinematics of an arm as trajectories need them."""

from __future__ import annotations

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller import ik
from rackhand.services.controller.ik import kernels
from rackhand.services.controller.trajectory.model import Placement, TcpPose


class ArmKinematics:
    """``Kinematics`` of an ``ik.Arm``. Stateless, so that several threads may use it."""

    def __init__(self, arm: ik.Arm) -> None:
        self._arm = arm

    def forward(self, q: Array) -> TcpPose:
        tool = self._frames(q)[-1]
        return TcpPose(tool[:, 3].copy(), tool[:, :3].copy())

    def jacobian(self, q: Array) -> Array:
        frames, columns = self._frames(q), np.empty((6, self._arm.n))
        kernels.jacobian(frames, columns)
        rotation = frames[-1, :, :3]
        return np.concatenate([rotation @ columns[:3], rotation @ columns[3:]])

    def manipulability(self, q: Array) -> float:
        """√det(J Jᵀ) at ``q`` (n,); 0 at a singularity (Yoshikawa 1985)."""
        columns = np.empty((6, self._arm.n))
        kernels.jacobian(self._frames(q), columns)
        return float(kernels.manipulability(columns))

    def solve(self, pose: Placement, q_near: Array) -> Array:
        target = np.column_stack([pose.rotation, pose.translation])
        return ik.solve_pose(self._arm, target, q_near).q

    def _frames(self, q: Array) -> Array:
        frames = np.empty((self._arm.n + 1, 3, 4))
        kernels.forward(self._arm.placements, np.ascontiguousarray(q, float), frames)
        return frames
