"""An arm without flaw: it follows the positions it is given smoothly, and its motors give what its model says."""

from __future__ import annotations

from collections import deque

import numpy as np
import pinocchio as pin

from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik import Arm
from rackhand.services.sim.arm.efforts import Efforts

STEP = 0.001  # s of its servo
BANDWIDTH = 100.0  # rad/s, the poles of its servo
LAG = 0.01  # s that it is behind what it is given: a command may come so late, or not at all, without a jolt
_KEPT = 64  # positions


class PerfectArm:
    """At ``home`` and at rest to begin with. Times are seconds of its own clock.

    ``q``, ``dq`` (n,) are where it is, rad and rad/s; ``efforts`` (n,) [N·m] are means over the last ``advance``, as a
    real drive reports them: a velocity that a contact watch differentiates has changed by just these torques.
    """

    def __init__(self, arm: Arm, period: float) -> None:
        self._model, self._data = arm.model, arm.model.createData()
        self._steps = round(period / STEP)
        self._mean = Efforts(arm.n, self._steps)
        self._given: deque[tuple[float, Array]] = deque(maxlen=_KEPT)
        self.time = 0.0
        self.q, self.dq = arm.home.copy(), np.zeros(arm.n)
        self.efforts = self._mean.mean(self._torque(self.q, self.dq, np.zeros(arm.n)))

    def go_to(self, q: Array, at: float) -> None:
        """Be at ``q`` (n,) ``LAG`` after the time ``at``, on the straight line there from the position given before."""
        self._given.append((at, q))

    def advance(self) -> None:
        """By one ``period``."""
        self._mean.begin()
        for _ in range(self._steps):
            self.time += STEP
            self._step(*self._wanted(self.time - LAG))
        self.efforts = self._mean.mean(self.efforts)

    def _step(self, q: Array, dq: Array) -> None:
        """A critically damped approach to what is wanted: ``q``, passed with ``dq``."""
        acceleration = BANDWIDTH**2 * (q - self.q) + 2 * BANDWIDTH * (dq - self.dq)
        middle = self.dq + 0.5 * STEP * acceleration
        self._mean.total += self._torque(self.q + 0.5 * STEP * middle, middle, acceleration)
        self.q, self.dq = self.q + STEP * middle, self.dq + STEP * acceleration

    def _torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        return np.asarray(pin.rnea(self._model, self._data, q, dq, ddq) + self._model.damping * dq)

    def _wanted(self, time: float) -> tuple[Array, Array]:
        """Position and velocity at ``time`` on the line through what was given; at rest before and after it."""
        later: tuple[float, Array] | None = None
        for at, q in reversed(self._given):
            if at <= time:
                if later is None:
                    return q, np.zeros_like(q)
                speed = (later[1] - q) / (later[0] - at)
                return q + (time - at) * speed, speed
            later = (at, q)
        return (self.q if later is None else later[1]), np.zeros_like(self.q)
