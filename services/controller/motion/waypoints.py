"""Way-points of a request as the queue takes them. Turned into arrays where they are planned, beside the loop."""

from __future__ import annotations

import numpy as np

from rackhand.schemas import crf_requests as crf
from rackhand.services.controller.motion.plan_worker import Append
from rackhand.services.controller.trajectory.model import Placement, Pose
from rackhand.services.controller.trajectory.queue import Method, MotionQueue, Reference


def append_joints(request: crf.AppendJointsPath) -> Append:
    def append(queue: MotionQueue, t: float) -> MotionQueue:
        return queue.append_joints(t, [np.array(point) for point in request.data])

    return append


def append_task(request: crf.AppendTaskPath, tcp: Placement) -> Append:
    """``tcp``: where the tool is at the call, which reference 2 refers to."""
    method, reference = Method(request.method), Reference(request.reference)

    def append(queue: MotionQueue, t: float) -> MotionQueue:
        points = [Pose(np.array(pose.position), pose.orientation.rotation()) for pose in request.data]
        return queue.append_task(t, points, method, reference, tcp)

    return append
