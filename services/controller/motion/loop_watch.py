"""Diagnostics of the control loop, and the path of the tool ahead. Nothing here decides about motion."""

from __future__ import annotations

import math

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.schemas.motion import ArmState, MotionDiagnostics, MotionPath
from rackhand.schemas.orientation import quaternion
from rackhand.services.controller.motion.executor import MotionExecutor
from rackhand.services.controller.motion.meter import Meter, Stopwatch
from rackhand.services.controller.motion.outline import outline
from rackhand.services.controller.trajectory.continuation import pose_error
from rackhand.services.controller.trajectory.queue import QueuedMotion


class LoopWatch:
    """Watches one arm's ``motion``. ``meter`` is to be held around each tick."""

    def __init__(self, motion: MotionExecutor, stopwatch: Stopwatch) -> None:
        self._motion = motion
        self.meter = Meter(stopwatch)
        self.late_ticks = 0
        self._outlined: tuple[QueuedMotion, ...] | None = None  # the motions of the last path published

    def diagnostics(self, state: ArmState, commanded: Array) -> MotionDiagnostics:
        """Of the tick that answers ``state``, for whose stamp the joint positions ``commanded`` (n,) were sent."""
        motion, q = self._motion, np.array(state.q)
        target = motion.kinematics.forward(commanded)
        error = pose_error(motion.kinematics.forward(q), target)
        x, y, z = target.translation.tolist()
        solver_us, iterations = motion.solver.read()
        return MotionDiagnostics(
            stamp=state.stamp,
            target_position=(x, y, z),
            target_orientation=quaternion(target.rotation),
            joint_errors=tuple((q - commanded).tolist()),
            linear_error=math.hypot(*error[:3]),
            angular_error=math.hypot(*error[3:]),
            tick_us=self.meter.read_us(),
            solver_us=solver_us,
            solver_iterations=iterations,
            late_ticks=self.late_ticks,
        )

    def changed_path(self, stamp: int) -> MotionPath | None:
        """The tool's way through the queue, if it is another than the last time."""
        queue = self._motion.queue
        if queue.motions is self._outlined:
            return None
        self._outlined = queue.motions
        points, ends = outline(queue, self._motion.time, self._motion.kinematics)
        return MotionPath(stamp=stamp, points=points, ends=ends)
