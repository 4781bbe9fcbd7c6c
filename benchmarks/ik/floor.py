"""What everything costs more than: pinocchio's kinematics and one damped least-squares step, without any limit."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dposv

from benchmarks.ik.walk import DT, Array


class Bare:
    """Forward kinematics and Jacobian, log6, one Cholesky solve. ``model``'s last frame is the tool."""

    name, limits = "bare pinocchio + damped least squares", "none"

    def __init__(self, model: pin.Model, frame: int) -> None:
        self.model, self.data, self.frame = model, model.createData(), frame
        self.eye = 1e-6 * np.eye(model.nv)

    def step(self, q: Array, _v: Array, _now: Array, then: Array, _twist: Array) -> Array:
        jac = pin.computeFrameJacobian(self.model, self.data, q, self.frame)
        error = pin.log6(self.data.iMf[0].actInv(pin.SE3(then[:, :3], then[:, 3]))).vector
        _, step, _ = dposv(np.dot(jac.T, jac) + self.eye, error @ jac)
        return np.asarray(step) / DT

    def distance(self, q: Array, target: Array) -> tuple[float, float]:
        """[m] and [rad] between the tool and a pose (3, 4)."""
        pin.forwardKinematics(self.model, self.data, q)
        pose = pin.updateFramePlacement(self.model, self.data, self.frame)
        apart = pose.translation - target[:, 3]
        turned = 0.5 * (np.sum(pose.rotation * target[:, :3]) - 1.0)
        return float(np.sqrt(apart @ apart)), float(np.arccos(min(1.0, max(-1.0, turned))))
