"""Torques on the joints that the arm's model does not explain."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rackhand.schemas.arrays import Array
from rackhand.schemas.motion import ArmState
from rackhand.services.controller import ik

GAIN = 40.0  # 1/s: a disturbance is seen with the time constant 1/GAIN
LONGEST = 0.05  # s without a state after which it begins anew
MISSED = 1.5  # periods between two states between which there was another: its efforts are not known


def resting_efforts(arm: ik.Arm, q: Array) -> Array:
    """Efforts (n,) [N·m] of an arm that is at rest at ``q`` with nothing at its flange: they carry its weight."""
    return np.array(pin.computeGeneralizedGravity(arm.model, arm.model.createData(), q))


class DisturbanceObserver:
    """What pushes at the links between base and flange, as joint torques; what passes through the flange is not in it.

    A filtered residual of the equation of motion, τ_ext = M a + h(q, v) + D v − τ − Jᵀw, which is the momentum observer
    in discrete time (De Luca, Albu-Schäffer, Haddadin and Hirzinger 2006, "Collision detection and safe reaction with
    the DLR-III lightweight manipulator arm"). ``a`` is the difference of measured velocities, ``τ`` the
    measured efforts, which are means between the same two states, ``w`` the measured wrench at the flange, so that tool
    and load need no model. ``period`` [s]: of the states.
    """

    def __init__(self, arm: ik.Arm, period: float) -> None:
        self._arm, self._period = arm, period
        self._data = arm.model.createData()
        # The flange in the frame of the last joint.
        pin.forwardKinematics(arm.model, self._data, arm.home)
        tool = ik.forward(arm, arm.home)
        self._flange = self._data.oMi[arm.model.njoints - 1].inverse() * pin.SE3(tool[:, :3], tool[:, 3])
        self._forces = [pin.Force.Zero() for _ in range(arm.model.njoints)]
        self.reset()

    def reset(self) -> None:
        """The next state begins anew, with no disturbance."""
        self._stamp: int | None = None
        self._velocity = np.zeros(self._arm.n)
        self.torque = np.zeros(self._arm.n)

    def see(self, state: ArmState) -> Array:
        """The disturbance (n,) [N·m] as of ``state``."""
        q, v, efforts = np.array(state.q), np.array(state.dq), np.array(state.efforts)
        dt = 0.0 if self._stamp is None else (state.stamp - self._stamp) * 1e-9
        if not 0.0 < dt <= LONGEST:
            self.torque = np.zeros(self._arm.n)
        elif dt <= MISSED * self._period:
            model, forces = self._arm.model, self._forces
            forces[-1] = self._flange.act(pin.Force(np.array(state.wrench)))
            middle = 0.5 * (v + self._velocity)
            needed = pin.rnea(model, self._data, q - 0.5 * dt * v, middle, (v - self._velocity) / dt, forces)
            residual = needed + model.damping * middle - efforts
            self.torque = self.torque + (residual - self.torque) * (GAIN * dt / (1.0 + GAIN * dt))
        self._stamp, self._velocity = state.stamp, v
        return self.torque
