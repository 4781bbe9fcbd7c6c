"""Joint torques of a torque reference, as long as the arm stays within its limits."""

from __future__ import annotations

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller import ik
from rackhand.services.controller.motion.kinematics import ArmKinematics
from rackhand.services.controller.motion.signal import SignalReference

LEAD = 3
"""Ticks that a torque still acts when it is ended at the next tick: until that, until its command takes
effect, and while the deceleration builds up."""


def ahead(q: Array, v: Array, gained: Array, period: float) -> tuple[Array, Array]:
    """Position and velocity, (n,) each, when a torque that is ended at the next tick has ended. ``gained`` (n,): the
    velocity gained in the last ``period``."""
    return q + LEAD * period * (v + 0.5 * LEAD * gained), v + LEAD * gained


def must_brake(arm: ik.Arm, q: Array, v: Array, gained: Array, period: float) -> bool:
    """Whether going on from the measured ``q`` and ``v`` (n,) would break a limit of position or velocity, before a
    stop that begins at the next tick could keep it. ``gained`` (n,): the velocity gained in the last ``period``."""
    q, v = ahead(q, v, gained, period)
    lower, upper = ik.velocity_box(arm, q, v, period)
    return bool((v > upper).any() or (v < lower).any())


def joint_torques(arm: ik.Arm, kinematics: ArmKinematics, reference: SignalReference, q: Array) -> Array:
    """(n,) N·m. A wrench takes Jᵀw, scaled down as a whole where a joint's torque limit is exceeded."""
    if reference.space == "joints":
        return reference.values
    torque = kinematics.jacobian(q).T @ reference.values
    excess = float((np.abs(torque) / arm.limits.torque).max())
    return np.asarray(torque / max(1.0, excess))
