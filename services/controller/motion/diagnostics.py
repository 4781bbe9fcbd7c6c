"""How well the loop does: what is measured against what was commanded, and what a tick costs."""

from __future__ import annotations

import math

import numpy as np

from schemas.motion import ArmState, MotionDiagnostics
from schemas.orientation import quaternion
from services.controller.motion.mover import Mover
from services.controller.trajectory.continuation import pose_error
from services.controller.trajectory.model import Array


def diagnostics(mover: Mover, state: ArmState, commanded: Array, tick_us: float, late_ticks: int) -> MotionDiagnostics:
    """Of the tick that answered ``state``, for whose instant the joints ``commanded`` (n,) had been asked."""
    q = np.array(state.q)
    target = mover.kinematics.forward(commanded)
    error = pose_error(mover.kinematics.forward(q), target)
    x, y, z = target.translation.tolist()
    iterations, mover.solver_iterations = mover.solver_iterations, 0
    return MotionDiagnostics(
        stamp=state.stamp,
        target_position=(x, y, z),
        target_orientation=quaternion(target.rotation),
        joint_errors=tuple((q - commanded).tolist()),
        linear_error=math.hypot(*error[:3]),
        angular_error=math.hypot(*error[3:]),
        tick_us=tick_us,
        solver_us=mover.solver_meter.read_us(),
        solver_iterations=iterations,
        late_ticks=late_ticks,
    )
