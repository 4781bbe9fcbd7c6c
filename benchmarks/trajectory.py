"""Trajectory time ÷ TOPP-RA time over 20 seeded waypoint paths, both arms.

Two references, both without any jerk limit and at the full velocity and acceleration limits:

* same path: TOPP-RA on exactly the blended path that is driven, on the same grid. What the ratio exceeds 1 by is the
  price of bounded jerk and of the planner's margins; without these two ours is the same problem, solved by ourselves.
* spline: TOPP-RA on the cubic spline through all waypoints, the usual way to use it, which rounds no corner.

Without `toppra` the same-path reference is our own solver without filter and margins.
"""

from __future__ import annotations

import importlib.util
import time
from dataclasses import dataclass

import numpy as np

from benchmarks.report import Report
from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik import load_arm
from rackhand.services.controller.trajectory.curve import JointCurve
from rackhand.services.controller.trajectory.geometry import Tolerance, joint_path
from rackhand.services.controller.trajectory.model import JointLimits
from rackhand.services.controller.trajectory.time_law import Smoothing
from rackhand.services.controller.trajectory.timing import Planning, plan, rows

HAS_TOPPRA = importlib.util.find_spec("toppra") is not None


ARMS = ("ur5e", "fr3")
FULL = Planning(velocity=1.0, acceleration=1.0, rounds=0)


@dataclass(frozen=True)
class Result:
    """Seconds of motion: ours, ours without jerk limit and margins, the two references; parts of the limits that ours
    uses at most; and the CPU seconds that planning took."""

    ours: float
    unbounded: float
    same_path: float
    spline: float
    use: tuple[float, float, float]
    planning: float


def waypoints(limits: JointLimits, seed: int) -> Array:
    """4 to 8 points uniformly in 80 % of the joint ranges, every second path in a third of that."""
    rng = np.random.default_rng(seed)
    middle, half = (limits.upper + limits.lower) / 2, (limits.upper - limits.lower) / 2
    size = 0.8 if seed % 2 else 0.27
    return np.asarray(middle + half * size * rng.uniform(-1, 1, (rng.integers(4, 9), len(half))))


def measure(limits: JointLimits, seed: int, planning: Planning) -> Result:
    points = waypoints(limits, seed)
    began = time.process_time()
    curve = joint_path(points, Tolerance()).curve()
    lines = rows(curve, limits, planning)
    timed = plan(curve, lines, planning)
    took = time.process_time() - began
    unbounded = plan(curve, lines, FULL).law.end
    bound = toppra_on_curve(limits, curve, lines.s) if HAS_TOPPRA else unbounded
    spline = toppra_on_spline(limits, points) if HAS_TOPPRA else float("nan")
    return Result(timed.law.end + planning.smoothing.total, unbounded, bound, spline, timed.use, took)


def toppra_on_curve(limits: JointLimits, curve: JointCurve, grid: Array) -> float:
    import toppra

    class Path(toppra.interpolator.AbstractGeometricPath):  # type: ignore[misc]
        dof = curve.q.shape[1]
        path_interval = np.array([curve.start, curve.end])

        def __call__(self, s: Array | float, order: int = 0) -> Array:
            values = curve.derivatives(np.atleast_1d(np.asarray(s, float)))[order]
            return values if np.ndim(s) else np.asarray(values[0])

    return _toppra(limits, Path(), np.unique(grid))


def toppra_on_spline(limits: JointLimits, points: Array) -> float:
    import toppra

    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return _toppra(limits, toppra.SplineInterpolator(s, points), np.linspace(0, s[-1], 401))


def _toppra(limits: JointLimits, path: object, grid: Array) -> float:
    import toppra

    bounds = [
        toppra.constraint.JointVelocityConstraint(np.column_stack([-limits.velocity, limits.velocity])),
        toppra.constraint.JointAccelerationConstraint(np.column_stack([-limits.acceleration, limits.acceleration])),
    ]
    solver = toppra.algorithm.TOPPRA(bounds, path, gridpoints=grid, parametrizer="ParametrizeConstAccel")
    return float(solver.compute_trajectory().duration)


def run(paths: int = 20) -> Report:
    lines, milliseconds, worst = [], [], 0.0
    reference = "`toppra`" if HAS_TOPPRA else "own solver without filter and margins"
    for name in ARMS:
        arm = load_arm(name).limits
        limits = JointLimits(arm.lower, arm.upper, arm.velocity, arm.acceleration, arm.jerk)
        planning = Planning(smoothing=Smoothing.for_limits(limits.acceleration, limits.jerk))
        measure(limits, 0, planning)  # compiles
        results = [measure(limits, seed, planning) for seed in range(paths)]
        same = f"{reference}, same path"
        lines.append(_spread(name, "bounded jerk, margins", same, [r.ours / r.same_path for r in results]))
        lines.append(_spread(name, "no jerk limit, no margins", same, [r.unbounded / r.same_path for r in results]))
        if HAS_TOPPRA:
            spline = "`toppra`, spline through the waypoints"
            lines.append(_spread(name, "bounded jerk, margins", spline, [r.ours / r.spline for r in results]))
        milliseconds += [1e3 * r.planning for r in results]
        worst = max(worst, *(max(r.use) for r in results))
    return Report(
        "Time of a trajectory against TOPP-RA",
        "python -m benchmarks trajectory",
        ("arm", "ours", "reference, without jerk limit", "ratio, median", "least", "most"),
        lines,
        f"{paths} seeded waypoint paths of each arm at its full velocity, acceleration and jerk limits, of "
        f"which ours uses {100 * worst:.1f} % at most. The references use velocity and acceleration to the full and "
        "know no jerk limit; without margins and jerk limit ours solves the very problem of the first reference. "
        f"Planning one path takes {np.median(milliseconds):.1f} ms of CPU (median).",
    )


def _spread(arm: str, ours: str, reference: str, ratios: list[float]) -> tuple[str, ...]:
    return arm, ours, reference, f"{np.median(ratios):.3f}", f"{min(ratios):.3f}", f"{max(ratios):.3f}"
