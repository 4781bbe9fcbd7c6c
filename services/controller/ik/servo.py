"""Differential inverse kinematics: one joint velocity a tick, by one QP, within every limit for any input.

    minimise    ½ |J v - w|²_W + ½ μ |v - g|²          w: the task, g: the secondary velocity of the objectives
    subject to  braking bound, velocity and acceleration of each joint (one box, which never is empty),
                no gap between spheres closing faster than it can be braked (rows)

Solved by Cholesky while nothing binds, by projected Newton when joints are at limits, by OSQP when rows are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.schemas.crf import CrfCode
from rackhand.services.controller.ik import kernels as k
from rackhand.services.controller.ik.arm import Arm
from rackhand.services.controller.ik.collision import Zone, build_table, collision_rows, stop_is_clear
from rackhand.services.controller.ik.objectives import Objectives
from rackhand.services.controller.ik.rowqp import RowSolver
from rackhand.services.controller.ik.twist_scaling import twist_scale


class Solver(IntEnum):
    """What found the velocity of a tick."""

    NONE = k.NONE  # input was not finite: braking
    CHOLESKY = k.CHOLESKY
    BOX = k.BOX
    ROWS = k.ROWS


@dataclass(frozen=True)
class SolverSettings:
    """Tuning of the tick. The defaults are measured; see ``benchmarks/ik``."""

    position_weight: float = 1.0  # of a metre of error, squared
    rotation_weight: float = 1.0  # of a radian, squared
    damping: float = 1e-6  # μ: how much the objective functions weigh against the task
    far_damping: float = 1e-3  # Levenberg-Marquardt, times the squared error
    singular_damping: float = 1e-4  # at manipulability 0; none from ``low_manipulability`` on
    low_manipulability: float = 0.01  # √det(J Jᵀ) below which the tick reports 801
    linear_tolerance: float = 1e-3  # [m] of error above which it reports 802
    angular_tolerance: float = 0.01  # [rad]
    collision_margin: float = 0.01  # [m] kept between spheres


class Step(NamedTuple):
    """What one tick found.

    ``codes`` are those of 800, 801, 802 and 804 that hold, the least severe first, none if all is well:
    800 the QP ended without proof of its optimum, 801 near a singularity, 802 the tool is off its target by more than
    the tolerance, 804 the input was not finite, or the motion was cut to keep a gap between spheres open.
    """

    velocity: Array  # (n,) [rad/s] for the coming period
    codes: tuple[CrfCode, ...]
    scale: float  # 0 … 1: how much of the motion asked for fits this tick; a path may slow its clock by it
    manipulability: float
    linear_error: float  # [m] between tool and target now
    angular_error: float  # [rad]
    solver: Solver
    iterations: int  # of that solver: factorisations, or OSQP's iterations


class DifferentialIk:
    """The servo of one arm's tool at a fixed period ``dt`` [s]. Positions and velocities are the *commanded* ones: feed
    back what it returned, integrated by ``q + v dt``; measurements belong to the joint servo below."""

    def __init__(self, arm: Arm, dt: float, settings: SolverSettings | None = None, blend_time: float = 1.0) -> None:
        if not 0.0 < dt < 0.1:
            raise ValueError(f"dt must be between 0 and 0.1 s, is {dt}")
        self.arm, self.dt = arm, dt
        self.objectives = Objectives(arm, blend_time)
        self.settings = settings or SolverSettings()
        self._work = k.TickWork.of(arm.n)
        self._no_secondary, self._no_twist = np.zeros(arm.n), np.zeros(6)
        self.set_zones(())

    @property
    def settings(self) -> SolverSettings:
        """May be replaced at any time."""
        return self._settings

    @settings.setter
    def settings(self, new: SolverSettings) -> None:
        self._free, self._held = arm_tables(self.arm, self.dt, new), arm_tables(self.arm, self.dt, new, held=True)
        self._settings = new

    def set_zones(self, zones: Sequence[Zone], self_collision: bool = False) -> None:
        """Replace the workspace's spheres, and switch the arm's own against each other."""
        table = build_table(self.arm, zones, self_collision, self.settings.collision_margin)
        m = len(table)
        self._table, self._rows = table, np.empty((m, self.arm.n))
        self._bounds, self._gaps = np.empty(m), np.empty(m)
        self._row_solver = RowSolver(self.arm.limits.velocity, m) if m else None

    def forward(self, q: Array) -> Array:
        """Pose (3, 4) = [R | p] of the tool in the base frame."""
        return forward(self.arm, q)

    def twist_scale(self, q: Array, v: Array, twist: Array) -> float:
        """The factor 0 … 1 by which to slow ``twist`` (6,), base axes at the tool, so that from ``q`` on the joints can
        follow it on its line: for velocities that are held, which do not know what lies ahead."""
        return float(twist_scale(self._held, q, v, twist))

    def step(
        self, q: Array, v: Array, target: Array | None = None, twist: Array | None = None, held: bool = False
    ) -> Step:
        """One tick from commanded position ``q`` and velocity ``v`` (n,).

        ``target`` (3, 4) is the tool's target *now*, ``twist`` (6,) [m/s, rad/s] how the target moves during the coming
        period, linear part first, axes of the base, point at the tool. No target: only the twist is followed, from
        wherever the tool is. ``held``: the target moves as ``twist_scale`` lets a held velocity; the joints then brake
        for the end of their range early enough that the tool stays on its line, and no other posture is taken.
        """
        if target is None:
            target = forward(self.arm, q)
        secondary = self.objectives.velocity(q) if self.objectives.advance(self.dt) else self._no_secondary
        twist = self._no_twist if twist is None else twist
        work = self._work
        k.tick(self._held if held else self._free, q, v, target, twist, secondary, work)
        scale, measure, linear, angular, solver, iterations = work.report.tolist()
        flags = 0
        if solver == k.NONE:
            flags = _HELD
        elif self._row_solver is not None:
            solver, flags = self._hold_rows(self._row_solver, q, solver)
            iterations = self._row_solver.iterations if solver == k.ROWS else iterations
        settings = self.settings
        if measure < settings.low_manipulability:
            flags |= _SINGULAR
        if linear > settings.linear_tolerance or angular > settings.angular_tolerance:
            flags |= _OFF_TARGET
        velocity = work.velocity.copy()
        return Step(velocity, _CODES[flags], scale, measure, linear, angular, _SOLVERS[int(solver)], int(iterations))

    def _hold_rows(self, row_solver: RowSolver, q: Array, solver: float) -> tuple[float, int]:
        """Replace the tick's velocity where it breaks a row. Returns the solver that it is then from, and the flags."""
        rows, bounds, work, flags = self._rows, self._bounds, self._work, 0
        out = work.velocity
        acceleration = self.arm.limits.acceleration
        collision_rows(self._table, acceleration, self.dt, work.frames, rows, bounds, self._gaps)
        lower, upper, c = work.box
        braking = np.clip(0.0, lower, upper)
        if np.any(rows @ out > bounds):
            # The box always holds braking, and backing out of the worst rows from there as far as it goes: where rows
            # ask for more than that, they ask for that. So there always is a solution.
            safe = braking
            for _ in range(_BACKING):
                excess = rows @ safe - bounds
                worst = int(excess.argmax())
                if excess[worst] <= 0.0:
                    break
                away = rows[worst] / max(rows[worst] @ rows[worst], 1e-9)
                safe = np.clip(safe - excess[worst] * away, lower, upper)
            bounds = np.maximum(bounds, rows @ safe)
            out[:], proven = row_solver.solve(work.h, c, lower, upper, rows, bounds, safe)
            solver, flags = k.ROWS, 0 if proven else _UNPROVEN
        trial = out
        for part in (0.75, 0.5, 0.25, 0.0):
            if stop_is_clear(self._table, self._gaps, self.arm.placements, acceleration, self.dt, q, trial):
                break
            trial = braking + part * (out - braking)
            flags |= _HELD
        out[:] = trial
        return solver, flags


_SOLVERS = tuple(Solver)
_BACKING = 12  # projections onto the worst row
_HELD_BRAKING = 0.5  # share of their acceleration with which joints brake for the end of their range
_LEAP = 0.05  # [rad] farther away is another posture
# Codes in CRF's order of severity, and the tuple for every combination, so that a tick builds none.
_SINGULAR, _OFF_TARGET, _UNPROVEN, _HELD = 1, 2, 4, 8
_ORDER = (
    (_SINGULAR, CrfCode.LowManipulability),
    (_OFF_TARGET, CrfCode.EndEffectorToleranceViolation),
    (_UNPROVEN, CrfCode.RealTimeViolation),
    (_HELD, CrfCode.WorkspaceViolation),
)
_CODES = tuple(tuple(code for bit, code in _ORDER if flags & bit) for flags in range(16))


def limit_table(arm: Arm, braking_share: float = 1.0) -> k.LimitTable:
    """The arm's limits as the kernels read them. ``braking_share``: of its acceleration, for the end of the range."""
    limits = arm.limits
    return k.LimitTable(
        limits.lower, limits.upper, limits.velocity, limits.acceleration, arm.home, braking_share * limits.acceleration
    )


def arm_tables(arm: Arm, dt: float, settings: SolverSettings, held: bool = False) -> k.ArmTables:
    """What a tick reads. ``held``: of a held velocity (see ``DifferentialIk.step``). Raises ValueError for settings
    that are negative or not finite."""
    weights = np.array([settings.position_weight] * 3 + [settings.rotation_weight] * 3)
    dampings = [settings.damping, settings.far_damping, settings.singular_damping]
    values = np.array([*weights, *dampings, settings.low_manipulability])
    if not (np.all(np.isfinite(values)) and np.all(values >= 0.0) and settings.damping > 0.0):
        raise ValueError(f"weights and dampings must be finite and not negative, damping positive: {settings}")
    tuning = k.Tuning(
        dt=float(dt),
        weights=weights,
        damping=float(settings.damping),
        far_damping=float(settings.far_damping),
        singular_damping=float(settings.singular_damping),
        singular_at=float(settings.low_manipulability),
        leap=_LEAP if held else math.inf,
    )
    return k.ArmTables(arm.placements, limit_table(arm, _HELD_BRAKING if held else 1.0), tuning)


def forward(arm: Arm, q: Array) -> Array:
    """Pose (3, 4) = [R | p] of the tool in the base frame."""
    frames = np.empty((arm.n + 1, 3, 4))
    k.forward(arm.placements, q, frames)
    return np.ascontiguousarray(frames[-1])


def velocity_box(arm: Arm, q: Array, v: Array, dt: float) -> tuple[Array, Array]:
    """Joint velocities (lower, upper) allowed for the coming period from commanded position ``q`` and velocity ``v``.

    For commands that need no kinematics. The box is never empty; a command clipped into it every tick breaks no limit
    of position, velocity or acceleration."""
    table, lower, upper = limit_table(arm), np.empty(arm.n), np.empty(arm.n)
    k.position_box(table, q, dt, lower, upper)
    k.acceleration_box(table, v, dt, lower, upper)
    return lower, upper
