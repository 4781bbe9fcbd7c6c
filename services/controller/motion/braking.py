"""A stop of all joints from any state, off whatever path there was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.joint_stop import JointStop, stop_joints
from rackhand.services.controller.trajectory.model import JointLimits
from rackhand.services.controller.trajectory.stream import Sample


def braking(t: float, now: Sample, limits: JointLimits, gentle: Array | None = None) -> JointStop:
    """The stop from ``now`` at ``t`` [s] within the arm's ``limits``; with the deceleration ``gentle`` (n,) [rad/s²]
    where that ends within the position limits."""
    stop = stop_joints(t, now, limits if gentle is None else replace(limits, acceleration=gentle))
    if limits.outside(stop.rest) is None:
        return stop
    # Close to the end of a joint's range its whole deceleration is needed, and at once.
    return stop_joints(t, replace(now, ddq=np.zeros_like(now.ddq)), replace(limits, jerk=limits.jerk * 1e3))
