"""A posture for a pose, from a seed or from the best of many."""

from __future__ import annotations

import math

import numpy as np

from rackhand.runtime.compiled import compiled
from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik.kernels.box import solve_box
from rackhand.services.controller.ik.kernels.chain import forward, jacobian, lengths, normal_matrix, pose_error
from rackhand.services.controller.ik.kernels.tables import LimitTable


@compiled
def search(
    placements: Array, limits: LimitTable, weights: Array, q: Array, target: Array, tolerance: Array, iterations: int
) -> tuple[bool, int]:
    """Move ``q`` (n,) within the limits to where the tool is at ``target`` (3, 4) within ``tolerance`` (linear [m],
    angular [rad]).

    Levenberg-Marquardt whose step is a box QP, at most a radian a joint; gives up when ten steps gain less than a
    tenth. Returns whether it converged and the number of steps; ``q`` is the best found."""
    n = q.shape[0]
    frames, jac, error, h = np.empty((n + 1, 3, 4)), np.empty((6, n)), np.empty(6), np.empty((n, n))
    c, low, high, step, best = np.empty(n), np.empty(n), np.empty(n), np.empty(n), q.copy()
    least, mark = np.inf, np.inf
    for iteration in range(iterations):
        forward(placements, q, frames)
        jacobian(frames, jac)
        squared = pose_error(frames[n], target, weights, error)
        if squared < least:
            least = squared
            best[:] = q
        linear, angular = lengths(error)
        if linear <= tolerance[0] and angular <= tolerance[1]:
            return True, iteration
        if iteration % 10 == 9:
            if least > 0.81 * mark:
                break
            mark = least
        normal_matrix(jac, weights, 1e-12 + 1e-3 * squared, h)
        c[:] = (weights * error) @ jac
        for i in range(n):
            low[i], high[i] = max(limits.lower[i] - q[i], -1.0), min(limits.upper[i] - q[i], 1.0)
            step[i] = 0.0
        solve_box(h, c, low, high, step)
        for i in range(n):
            q[i] += step[i]
            if iteration % 5 == 4:  # against its limit: the same pose a turn away, where there is room
                if q[i] >= limits.upper[i] and q[i] - 2.0 * math.pi > limits.lower[i]:
                    q[i] -= 2.0 * math.pi
                elif q[i] <= limits.lower[i] and q[i] + 2.0 * math.pi < limits.upper[i]:
                    q[i] += 2.0 * math.pi
    q[:] = best
    return False, iteration + 1


@compiled
def nearest(placements: Array, weights: Array, seeds: Array, target: Array) -> int:
    """Index of the row of ``seeds`` (m, n) that has the tool closest to ``target``."""
    n = seeds.shape[1]
    frames, error = np.empty((n + 1, 3, 4)), np.empty(6)
    best, least = 0, np.inf
    for i in range(seeds.shape[0]):
        forward(placements, seeds[i], frames)
        squared = pose_error(frames[n], target, weights, error)
        if squared < least:
            best, least = i, squared
    return best
