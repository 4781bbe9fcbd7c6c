"""What is told of the loop to those who look: how well it does, and where the tool is about to go. Decides nothing."""

from __future__ import annotations

import math

import numpy as np

from rackhand.schemas.motion import ArmState, MotionDiagnostics, MotionPath
from rackhand.schemas.orientation import quaternion
from rackhand.services.controller.motion.executor import MotionExecutor
from rackhand.services.controller.motion.meter import Meter, Stopwatch
from rackhand.services.controller.motion.outline import outline
from rackhand.services.controller.trajectory.continuation import pose_error
from rackhand.services.controller.trajectory.model import Array
from rackhand.services.controller.trajectory.queue import QueuedMotion


class LoopWatch:
    """Watches one arm's ``mover``. ``meter`` is to be held around each tick."""

    def __init__(self, mover: MotionExecutor, stopwatch: Stopwatch) -> None:
        self._mover = mover
        self.meter = Meter(stopwatch)
        self.late_ticks = 0
        self._outlined: tuple[QueuedMotion, ...] | None = None  # the motions whose way was told

    def diagnostics(self, state: ArmState, commanded: Array) -> MotionDiagnostics:
        """Of the tick that answers ``state``, for whose instant the joints ``commanded`` (n,) had been asked."""
        mover, q = self._mover, np.array(state.q)
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
            tick_us=self.meter.read_us(),
            solver_us=mover.solver_meter.read_us(),
            solver_iterations=iterations,
            late_ticks=self.late_ticks,
        )

    def changed_path(self, stamp: int) -> MotionPath | None:
        """The tool's way through the queue, if it is another than the last time."""
        queue = self._mover.queue
        if queue.legs is self._outlined:
            return None
        self._outlined = queue.legs
        points, ends = outline(queue, self._mover.time, self._mover.kinematics)
        return MotionPath(stamp=stamp, points=points, ends=ends)
