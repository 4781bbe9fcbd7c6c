"""What several tests measure on a motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.model import JointLimits
from rackhand.services.controller.trajectory.stream import Sample


@dataclass(frozen=True)
class Record:
    """A motion sampled every ``dt``: rows are times."""

    dt: float
    q: Array
    dq: Array
    ddq: Array

    def use(self, limits: JointLimits) -> tuple[float, float, float]:
        """Largest share of the velocity, acceleration and jerk limits; jerk as a difference of accelerations."""
        jerk = np.diff(self.ddq, axis=0) / self.dt
        return (
            float((np.abs(self.dq) / limits.velocity).max()),
            float((np.abs(self.ddq) / limits.acceleration).max()),
            float((np.abs(jerk) / limits.jerk).max()),
        )

    def jumps(self) -> tuple[float, float]:
        """By how much positions and velocities differ from what velocities and accelerations integrate to in one step
        (trapezoid with its end correction, trapezoid): rounding and jerk · dt², unless something jumps."""
        dt = self.dt
        q = np.diff(self.q, axis=0) - dt * (self.dq[1:] + self.dq[:-1]) / 2 + dt**2 / 12 * np.diff(self.ddq, axis=0)
        dq = np.diff(self.dq, axis=0) - dt * (self.ddq[1:] + self.ddq[:-1]) / 2
        return float(np.abs(q).max()), float(np.abs(dq).max())


def record(at: Callable[[float], Sample], start: float, end: float, dt: float = 0.002) -> Record:
    samples = [at(t) for t in np.arange(start, end + dt, dt)]
    return Record(dt, *(np.array([getattr(sample, name) for sample in samples]) for name in ("q", "dq", "ddq")))
