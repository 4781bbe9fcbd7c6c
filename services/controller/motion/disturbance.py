"""Torques on the joints that the arm's model does not explain."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rackhand.schemas.arrays import Array
from rackhand.schemas.motion import ArmState
from rackhand.services.controller import ik

GAIN = 40.0  # 1/s: a disturbance is seen with the time constant 1/GAIN
LONGEST = 0.05  # s without a state after which it begins anew
MISSED = 1.5  # usual gaps between two states between which there was another: its efforts are not known
USUAL = 0.1  # weight of a new gap in the usual one


def resting_efforts(arm: ik.Arm, q: Array) -> Array:
    """Efforts (n,) [N·m] of an arm that is at rest at ``q`` with nothing at its flange: they carry its weight."""
    return np.array(pin.computeGeneralizedGravity(arm.model, arm.model.createData(), q))


class DisturbanceObserver:
    """What pushes at the links between base and flange, as joint torques; what passes through the flange is not in it.

    A filtered residual of the equation of motion, τ_ext = M a + h(q, v) + D v − τ − Jᵀw, which is the momentum observer
    in discrete time (De Luca, Albu-Schäffer, Haddadin and Hirzinger 2006, "Collision detection and safe reaction with
    the DLR-III lightweight manipulator arm"). ``a`` is the difference of velocities measured at two ticks, ``τ`` and
    ``w`` the means between these of the measured efforts and of the measured wrench at the flange, so that tool and
    load need no model. A driver may publish more states than there are ticks, and its efforts are means since the state
    before: what the motors did is only known if every state is taken in.
    """

    def __init__(self, arm: ik.Arm) -> None:
        self._arm = arm
        self._data, self._damping = arm.model.createData(), arm.model.damping.copy()
        # The flange in the frame of the last joint.
        pin.forwardKinematics(arm.model, self._data, arm.home)
        tool = ik.forward(arm, arm.home)
        self._flange = self._data.oMi[arm.model.njoints - 1].inverse() * pin.SE3(tool[:, :3], tool[:, 3])
        self._forces = pin.StdVec_Force()  # a list would be converted at every call
        self._forces.extend([pin.Force.Zero() for _ in range(arm.model.njoints)])
        self.reset()

    def reset(self) -> None:
        """The next state begins anew, with no disturbance."""
        self._stamp: int | None = None  # of the last tick
        self._taken: int | None = None  # of the last state
        self._usual_gap = 0.0  # ns between two states; 0: not known yet
        self._velocity = np.zeros(self._arm.n)
        self._begin(known=False)
        self.torque = np.zeros(self._arm.n)

    def _begin(self, known: bool) -> None:
        self._known = known  # whether every state since the last tick is taken in
        self._impulse, self._wrench = np.zeros(self._arm.n), np.zeros(6)  # N·m ns and N ns since then

    def take(self, state: ArmState) -> None:
        """What the motors did until ``state``. For every state, in order."""
        gap = 0 if self._taken is None else state.stamp - self._taken
        self._taken = state.stamp
        if gap <= 0:
            return
        self._known &= gap <= MISSED * self._usual_gap
        known = self._usual_gap or gap
        self._usual_gap = known + USUAL * (min(gap, 2.0 * known) - known)
        self._impulse += gap * np.array(state.efforts)
        self._wrench += gap * np.array(state.wrench)

    def see(self, state: ArmState) -> Array:
        """The disturbance (n,) [N·m] as of ``state``, at which there is a tick. It need not be taken in before."""
        if state.stamp != self._taken:
            self.take(state)
        q, v = np.array(state.q), np.array(state.dq)
        ns = 0 if self._stamp is None else state.stamp - self._stamp
        dt = ns * 1e-9
        if not 0.0 < dt <= LONGEST:
            self.torque = np.zeros(self._arm.n)
        elif self._known:
            model, forces = self._arm.model, self._forces
            forces[model.njoints - 1] = self._flange.act(pin.Force(self._wrench / ns))
            middle = 0.5 * (v + self._velocity)
            needed = pin.rnea(model, self._data, q - 0.5 * dt * v, middle, (v - self._velocity) / dt, forces)
            residual = needed + self._damping * middle - self._impulse / ns
            self.torque = self.torque + (residual - self.torque) * (GAIN * dt / (1.0 + GAIN * dt))
        self._stamp, self._velocity = state.stamp, v
        self._begin(known=True)
        return self.torque
