"""The solver's arm as trajectories ask for it."""

from __future__ import annotations

import numpy as np

from rackhand.services.controller import ik
from rackhand.services.controller.ik import kernels
from rackhand.services.controller.trajectory.model import Array, Placement, Pose


class ArmKinematics:
    """``Kinematics`` of an ``ik.Arm``. Keeps nothing between calls, so that several threads may use it."""

    def __init__(self, arm: ik.Arm) -> None:
        self._arm = arm

    def forward(self, q: Array) -> Pose:
        tool = self._frames(q)[-1]
        return Pose(tool[:, 3].copy(), tool[:, :3].copy())

    def jacobian(self, q: Array) -> Array:
        frames, columns = self._frames(q), np.empty((6, self._arm.n))
        kernels.jacobian(frames, columns)
        rotation = frames[-1, :, :3]
        return np.concatenate([rotation @ columns[:3], rotation @ columns[3:]])

    def solve(self, pose: Placement, q_near: Array) -> Array:
        target = np.column_stack([pose.rotation, pose.translation])
        return ik.solve_pose(self._arm, target, q_near).q

    def _frames(self, q: Array) -> Array:
        frames = np.empty((self._arm.n + 1, 3, 4))
        kernels.forward(self._arm.placements, np.ascontiguousarray(q, float), frames)
        return frames
