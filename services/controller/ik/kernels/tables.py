"""What the kernels read of an arm and of the tuning, and what a tick writes: NamedTuples, which numba compiles.

They are made once (``servo.arm_tables``, ``TickWork.of``) and passed to every call.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rackhand.schemas.arrays import Array


class LimitTable(NamedTuple):
    """Per joint, (n,) each: positions [rad], velocity [rad/s], acceleration [rad/s²]; ``braking`` [rad/s²] is the
    deceleration with which joints stop before the end of their range, ``home`` [rad] a posture to start searches
    from."""

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    home: Array
    braking: Array


class Tuning(NamedTuple):
    """``dt`` [s]: the period. ``weights`` (6,): of the squared error, linear part first. ``damping`` μ: of the null
    space. ``far_damping``: Levenberg-Marquardt, times the squared error. ``singular_damping``: at manipulability 0,
    none from ``singular_at`` on. ``leap`` [rad]: a goal farther away is another posture, and not taken."""

    dt: float
    weights: Array
    damping: float
    far_damping: float
    singular_damping: float
    singular_at: float
    leap: float


class ArmTables(NamedTuple):
    """``placements`` (n+1, 3, 4): see ``Arm``."""

    placements: Array
    limits: LimitTable
    tuning: Tuning


class TickWork(NamedTuple):
    """Outputs and memory of ``tick``. ``goals`` (2, n): the postures where the joints will come to rest, kept from tick
    to tick, NaN at first. ``frames`` (n+1, 3, 4): pose of every joint and the tool. The QP min ½vᵀHv - cᵀv has H in
    ``h`` (n, n), its bounds and c in ``box`` (3, n). ``velocity`` (n,): the result. ``report``: see ``tick``."""

    goals: Array
    frames: Array
    h: Array
    box: Array
    velocity: Array
    report: Array

    @classmethod
    def of(cls, n: int) -> TickWork:
        """For ``n`` joints."""
        return cls(
            np.full((2, n), np.nan),
            np.empty((n + 1, 3, 4)),
            np.empty((n, n)),
            np.empty((3, n)),
            np.empty(n),
            np.empty(REPORT),
        )


# Entries of what a tick reports.
SCALE, MEASURE, ERROR_LINEAR, ERROR_ANGULAR, SOLVER, ITERATIONS, REPORT = 0, 1, 2, 3, 4, 5, 6
# Values of the entry SOLVER.
NONE, CHOLESKY, BOX, ROWS = 0, 1, 2, 3
