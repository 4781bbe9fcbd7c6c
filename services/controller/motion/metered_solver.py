"""The differential inverse kinematics with a meter around every step."""

from __future__ import annotations

from rackhand.schemas.arrays import Array
from rackhand.services.controller import ik
from rackhand.services.controller.motion.meter import Meter, Stopwatch


class MeteredSolver:
    """``ik.DifferentialIk.step`` of one arm, its time and its iterations."""

    def __init__(self, solver: ik.DifferentialIk, stopwatch: Stopwatch) -> None:
        self.ik = solver
        self._meter = Meter(stopwatch)
        self._iterations = 0

    def step(self, q: Array, v: Array, target: Array, twist: Array, held: bool) -> ik.Step:
        """See ``ik.DifferentialIk.step``."""
        with self._meter.measure():
            step = self.ik.step(q, v, target, twist, held)
        self._iterations = max(self._iterations, step.iterations)
        return step

    def read(self) -> tuple[float, int]:
        """The longest step [µs] and the most iterations of one since the last call."""
        iterations, self._iterations = self._iterations, 0
        return self._meter.read_us(), iterations
