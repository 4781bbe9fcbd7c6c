"""The path of the tool through a queue, for display."""

from __future__ import annotations

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller.motion.kinematics import ArmKinematics
from rackhand.services.controller.trajectory.queue import MotionQueue, QueuedMotion
from rackhand.services.controller.trajectory.stream import Motion

SPACING = 0.02  # seconds between points, unless there would be more than MOST
MOST = 128


def outline(queue: MotionQueue, t: float, kinematics: ArmKinematics) -> tuple[Array, tuple[int, ...]]:
    """Tool positions (m, 3) in the base frame from ``t`` to the end of what is queued, evenly spaced in time within a
    motion; and the row at which each motion ends."""
    motions = [queued for queued in queue.motions if queued.motion.end > t]
    total = sum(queued.motion.end - max(t, queued.begin) for queued in motions)
    spacing = max(SPACING, total / MOST)
    points: list[Array] = []
    ends: list[int] = []
    for queued in motions:
        points.extend(kinematics.forward(q).translation for q in _joints(queued, max(t, queued.begin), spacing))
        ends.append(len(points) - 1)
    return np.array(points).reshape(-1, 3), tuple(ends)


def _joints(queued: QueuedMotion, begin: float, spacing: float) -> Array:
    """Joint positions (m, n) of a motion from ``begin`` to its end."""
    motion = queued.motion
    times = np.linspace(begin, motion.end, max(int(np.ceil((motion.end - begin) / spacing)), 1) + 1)
    if isinstance(motion, Motion):
        s = motion.law.filtered(times, motion.planning.smoothing)[:, 0]
        return np.asarray(motion.curve.derivatives(s)[0])
    return np.array([motion.at(float(time)).q for time in times])
