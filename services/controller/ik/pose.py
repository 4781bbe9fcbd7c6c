"""Inverse kinematics of a pose: joint positions that bring the tool there, within the limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik import kernels as k
from rackhand.services.controller.ik.arm import Arm
from rackhand.services.controller.ik.servo import forward, limit_table


@dataclass(frozen=True, slots=True)
class PoseSolution:
    """Joint positions, whether they meet the tolerance, and what they miss it by."""

    q: Array  # (n,), within the limits; the nearest found if ``reached`` is false
    reached: bool
    linear_error: float  # [m]
    angular_error: float  # [rad]
    restarts: int
    iterations: int


def solve_pose(
    arm: Arm,
    target: Array,
    q0: Array,
    *,
    linear_tolerance: float = 1e-5,
    angular_tolerance: float = 1e-5,
    restarts: int = 20,
    iterations: int = 100,
    seed: int = 0,
) -> PoseSolution:
    """Joint positions with the tool at ``target`` (3, 4), sought from ``q0`` (n,), then from random starts.

    Each restart takes, of a growing number of random postures, the one with the tool nearest the target. The same
    seed gives the same answer. With ``restarts=0`` the solution is the one that ``q0`` leads to, as following a path
    needs it.

    Raises ValueError if target or q0 is not finite or of the wrong shape.
    """
    target, q0 = np.ascontiguousarray(target, float), np.asarray(q0, float)
    if target.shape != (3, 4) or q0.shape != (arm.n,) or not (np.all(np.isfinite(target)) and np.all(np.isfinite(q0))):
        raise ValueError(f"a finite (3, 4) target and ({arm.n},) start were expected, got {target.shape}, {q0.shape}")
    limits, weights = limit_table(arm), np.ones(6)
    tolerance = np.array([linear_tolerance, angular_tolerance])
    random, error = np.random.default_rng(seed), np.empty(6)
    best, least, total, tried = q0, np.inf, 0, 0
    start = np.clip(q0, arm.limits.lower, arm.limits.upper)
    for tried in range(restarts + 1):
        if tried:
            postures = random.uniform(arm.limits.lower, arm.limits.upper, (64 << min(tried, 5), arm.n))
            start = postures[k.nearest(arm.placements, weights, postures, target)].copy()
        reached, steps = k.search(arm.placements, limits, weights, start, target, tolerance, iterations)
        total += steps
        squared = k.pose_error(forward(arm, start), target, weights, error)
        if reached or squared < least:
            best, least = start, squared
        if reached:
            break
    k.pose_error(forward(arm, best), target, weights, error)
    linear, angular = k.lengths(error)
    return PoseSolution(best, bool(reached), float(linear), float(angular), tried, total)
