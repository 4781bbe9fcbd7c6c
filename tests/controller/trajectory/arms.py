"""Arms for the tests: Denavit–Hartenberg chains with published parameters, independent of the solver's package."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.continuation import pose_error
from rackhand.services.controller.trajectory.model import JointLimits, TcpPose


@dataclass(frozen=True)
class Chain:
    """Rows of ``table`` (n, 3) are a, alpha, d. ``modified``: Craig's convention, else the classic one."""

    table: Array
    modified: bool = False

    def frames(self, q: Array) -> list[Array]:
        """Base frame, then the frame after every joint; in Craig's convention the joint's axis is its own z."""
        frames = [np.eye(4)]
        for (a, alpha, d), angle in zip(self.table, q, strict=True):
            turn, along = _rot_z(angle), np.eye(4)
            turn[2, 3] = d
            along[:3, :3] = _rot_x(alpha)
            along[0, 3] = a
            frames.append(frames[-1] @ (along @ turn if self.modified else turn @ along))
        return frames

    def forward(self, q: Array) -> TcpPose:
        tip = self.frames(q)[-1]
        return TcpPose(tip[:3, 3], tip[:3, :3])

    def jacobian(self, q: Array) -> Array:
        frames = self.frames(q)
        joints = frames[1:] if self.modified else frames[:-1]
        tip = frames[-1][:3, 3]
        return np.array([[*np.cross(f[:3, 2], tip - f[:3, 3]), *f[:3, 2]] for f in joints]).T

    def solve(self, pose: TcpPose, q_near: Array) -> Array | None:
        q = q_near
        for _ in range(100):
            error = pose_error(self.forward(q), pose)
            if np.abs(error).max() < 1e-10:
                return q
            J = self.jacobian(q)
            step = J.T @ np.linalg.solve(J @ J.T + 1e-3 * (error @ error) * np.eye(6) + 1e-12 * np.eye(6), error)
            q = q + step * min(1.0, 0.5 / np.abs(step).max())
        return None


def _rot_z(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def _rot_x(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


_H = np.pi / 2
UR5E = Chain(
    np.array(
        [
            [0.0, _H, 0.1625],
            [-0.425, 0.0, 0.0],
            [-0.3922, 0.0, 0.0],
            [0.0, _H, 0.1333],
            [0.0, -_H, 0.0997],
            [0.0, 0.0, 0.0996],
        ]
    )
)
UR5E_LIMITS = JointLimits(
    np.full(6, -2 * np.pi), np.full(6, 2 * np.pi), np.full(6, np.pi), np.full(6, 8.0), np.full(6, 800.0)
)
UR5E_HOME = np.array([0.0, -1.3, 1.9, -2.2, -1.57, 0.3])

FR3 = Chain(
    np.array(
        [
            [0.0, 0.0, 0.333],
            [0.0, -_H, 0.0],
            [0.0, _H, 0.316],
            [0.0825, _H, 0.0],
            [-0.0825, -_H, 0.384],
            [0.0, _H, 0.0],
            [0.088, _H, 0.107],
        ]
    ),
    modified=True,
)
FR3_LIMITS = JointLimits(
    np.array([-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159]),
    np.array([2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159]),
    np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]),
    np.full(7, 10.0),
    np.full(7, 1000.0),
)
FR3_HOME = np.array([0.0, -0.5, 0.0, -2.2, 0.0, 1.8, 0.7])
