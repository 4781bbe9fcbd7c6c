"""Trajectory time ÷ TOPP-RA time over 20 seeded way-point paths.

Two references, both without any jerk limit and at the full velocity and acceleration limits:

* same path: TOPP-RA on exactly the blended path that is driven. What the ratio exceeds 1 by is the price of bounded
  jerk, of the planner's margins, and of discretisation.
* spline: TOPP-RA on the cubic spline through all way-points, the usual way to use it, which rounds no corner.

Without `toppra` the same-path reference is our own solver without filter and margins.
"""

from __future__ import annotations

import importlib.util
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.report import Report
from services.controller.trajectory.curve import JointCurve
from services.controller.trajectory.geometry import Tolerance, joint_path
from services.controller.trajectory.model import JointLimits
from services.controller.trajectory.phase import Smoothing
from services.controller.trajectory.timing import Planning, plan, rows

Array = NDArray[np.float64]

# Franka Research 3, base to flange (Franka Control Interface).
FR3 = JointLimits(
    np.array([-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159]),
    np.array([2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159]),
    np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]),
    np.full(7, 10.0),
    np.full(7, 5000.0),
)
HAS_TOPPRA = importlib.util.find_spec("toppra") is not None


@dataclass(frozen=True)
class Result:
    """Seconds of motion, and the CPU seconds that planning took."""

    ours: float
    same_path: float
    spline: float
    use: tuple[float, float, float]
    planning: float


def way_points(seed: int) -> Array:
    """4 to 8 points uniformly in 80 % of the joint ranges, every second path in a third of that."""
    rng = np.random.default_rng(seed)
    middle, half = (FR3.upper + FR3.lower) / 2, (FR3.upper - FR3.lower) / 2
    size = 0.8 if seed % 2 else 0.27
    return np.asarray(middle + half * size * rng.uniform(-1, 1, (rng.integers(4, 9), 7)))


def measure(seed: int, planning: Planning) -> Result:
    points = way_points(seed)
    began = time.process_time()
    curve = joint_path(points, Tolerance()).curve()
    lines = rows(curve, FR3, planning)
    timed = plan(curve, lines, planning)
    took = time.process_time() - began
    full = Planning(velocity=1.0, acceleration=1.0, rounds=0)
    bound = toppra_on_curve(curve, lines.s) if HAS_TOPPRA else plan(curve, lines, full).phase.end
    spline = toppra_on_spline(points) if HAS_TOPPRA else float("nan")
    return Result(timed.phase.end + planning.smoothing.total, bound, spline, timed.use, took)


def toppra_on_curve(curve: JointCurve, grid: Array) -> float:
    import toppra

    class Path(toppra.interpolator.AbstractGeometricPath):  # type: ignore[misc]
        dof = curve.q.shape[1]
        path_interval = np.array([curve.start, curve.end])

        def __call__(self, s: Array | float, order: int = 0) -> Array:
            values = curve.derivatives(np.atleast_1d(np.asarray(s, float)))[order]
            return values if np.ndim(s) else np.asarray(values[0])

    return _toppra(Path(), np.unique(grid))


def toppra_on_spline(points: Array) -> float:
    import toppra

    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return _toppra(toppra.SplineInterpolator(s, points), np.linspace(0, s[-1], 401))


def _toppra(path: object, grid: Array) -> float:
    import toppra

    limits = [
        toppra.constraint.JointVelocityConstraint(np.column_stack([-FR3.velocity, FR3.velocity])),
        toppra.constraint.JointAccelerationConstraint(np.column_stack([-FR3.acceleration, FR3.acceleration])),
    ]
    solver = toppra.algorithm.TOPPRA(limits, path, gridpoints=grid, parametrizer="ParametrizeConstAccel")
    return float(solver.compute_trajectory().duration)


def run(paths: int = 20) -> Report:
    planning = Planning(smoothing=Smoothing.for_limits(FR3.acceleration, FR3.jerk))
    measure(0, planning)  # compiles
    results = [measure(seed, planning) for seed in range(paths)]
    reference = "`toppra`" if HAS_TOPPRA else "own solver without filter and margins"
    rows = [_spread(f"{reference}, same path", [r.ours / r.same_path for r in results])]
    if HAS_TOPPRA:
        rows.append(_spread("`toppra` on the spline through the way-points", [r.ours / r.spline for r in results]))
    milliseconds = 1e3 * np.median([r.planning for r in results])
    return Report(
        "Time of a trajectory against TOPP-RA",
        "python -m benchmarks trajectory",
        ("reference, without jerk limit", "ratio, median", "least", "most"),
        rows,
        f"{paths} seeded way-point paths of the FR3. Ours bounds jerk and keeps a margin to each limit; the references "
        f"use velocity and acceleration to the full. Planning one takes {milliseconds:.1f} ms of CPU (median).",
    )


def _spread(name: str, ratios: list[float]) -> tuple[str, ...]:
    return name, f"{np.median(ratios):.3f}", f"{min(ratios):.3f}", f"{max(ratios):.3f}"
