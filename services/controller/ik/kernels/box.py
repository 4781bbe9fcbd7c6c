"""Velocities that keep every joint within its limits, as a box; and the QP in it."""

from __future__ import annotations

import math

import numpy as np

from rackhand.runtime.compiled import compiled
from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik.kernels.tables import LimitTable

PROJECTED = 12  # steps of projected Newton, which seldom takes more than six


@compiled
def cholesky(h: Array, size: int, factor: Array) -> float:
    """Lower factor of the leading ``size`` rows of positive definite ``h``. Returns the least pivot."""
    least = np.inf
    for i in range(size):
        for j in range(i + 1):
            total = h[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(max(total, 1e-300)) if i == j else total / factor[j, j]
        least = min(least, total)
    return least


@compiled
def cholesky_solve(factor: Array, size: int, b: Array, x: Array) -> None:
    """x = (L Lᵀ)⁻¹ b; x may be b."""
    for i in range(size):
        total = b[i]
        for k in range(i):
            total -= factor[i, k] * x[k]
        x[i] = total / factor[i, i]
    for i in range(size - 1, -1, -1):
        total = x[i]
        for k in range(i + 1, size):
            total -= factor[k, i] * x[k]
        x[i] = total / factor[i, i]


@compiled
def solve_box(h: Array, c: Array, lower: Array, upper: Array, x: Array) -> int:
    """min ½ xᵀHx - cᵀx within the box, H positive definite: exact to rounding. Starts at ``x``, leaves the solution
    there. Projected Newton (Bertsekas 1982): Newton's step on the free coordinates, cut to the box, with Armijo's rule.
    Where that zigzags between faces of the box, which badly conditioned H make it do, ``walk_faces`` takes over.

    Returns the number of factorisations, negative when it gave up (which no test has seen)."""
    n = c.shape[0]
    gradient, free = np.empty(n), np.empty(n, np.int64)
    part, factor, step, trial = np.empty((n, n)), np.empty((n, n)), np.empty(n), np.empty(n)
    for i in range(n):
        x[i] = min(max(x[i], lower[i]), upper[i])
    for iteration in range(PROJECTED):
        size = 0
        for i in range(n):
            total = -c[i]
            for j in range(n):
                total += h[i, j] * x[j]
            gradient[i] = total
            if not ((x[i] <= lower[i] and total >= 0.0) or (x[i] >= upper[i] and total <= 0.0)):
                free[size] = i
                size += 1
        for a in range(size):
            step[a] = -gradient[free[a]]
            for b in range(a + 1):
                part[a, b] = h[free[a], free[b]]
        cholesky(part, size, factor)
        cholesky_solve(factor, size, step, step)
        largest = 0.0
        for a in range(size):
            i = free[a]
            largest = max(largest, abs(min(max(x[i] + step[a], lower[i]), upper[i]) - x[i]))
        length = 1.0
        for _ in range(30):
            trial[:] = x
            slope = 0.0
            for a in range(size):
                i = free[a]
                trial[i] = min(max(x[i] + length * step[a], lower[i]), upper[i])
                slope += gradient[i] * (trial[i] - x[i])
            change = slope
            for i in range(n):
                for j in range(n):
                    change += 0.5 * (trial[i] - x[i]) * h[i, j] * (trial[j] - x[j])
            if largest <= 1e-9 or change <= 1e-4 * slope:
                break
            length *= 0.5
        cut = size < n
        for a in range(size):
            i = free[a]
            cut |= trial[i] != x[i] + step[a]
        x[:] = trial
        if largest <= (1e-9 if cut else 1e-3):  # a full step of all coordinates leaves nothing but its rounding
            return iteration + 1
    more = walk_faces(h, c, lower, upper, x)
    return PROJECTED + more if more > 0 else more - PROJECTED


@compiled
def walk_faces(h: Array, c: Array, lower: Array, upper: Array, x: Array) -> int:
    """``solve_box`` by the primal active-set method (Nocedal & Wright 2006, §16.5): to the minimum of a face of the box
    or the first bound on the way, which then holds; at a minimum, the bound that pushes inwards most is let go. Takes
    more steps than projected Newton, and always arrives."""
    n = c.shape[0]
    held, free = np.zeros(n, np.bool_), np.empty(n, np.int64)
    part, factor, step = np.empty((n, n)), np.empty((n, n)), np.empty(n)
    for i in range(n):
        held[i] = x[i] <= lower[i] or x[i] >= upper[i]
    for iteration in range(60):
        gradient = h @ x - c
        size = 0
        for i in range(n):
            if not held[i]:
                free[size] = i
                size += 1
        # As in ``solve_box``, written out: a function for both costs that one, at every tick, 7 %.
        for a in range(size):
            step[a] = -gradient[free[a]]
            for b in range(a + 1):
                part[a, b] = h[free[a], free[b]]
        cholesky(part, size, factor)
        cholesky_solve(factor, size, step, step)
        length, first, largest = 1.0, -1, 0.0
        for a in range(size):
            i = free[a]
            largest = max(largest, abs(step[a]))
            room = (upper[i] if step[a] > 0.0 else lower[i]) - x[i]
            if abs(step[a]) > 1e-300 and room / step[a] < length:
                length, first = room / step[a], i
        for a in range(size):
            i = free[a]
            x[i] = min(max(x[i] + length * step[a], lower[i]), upper[i])
        if first >= 0:
            held[first] = True
            x[first] = lower[first] if x[first] - lower[first] < upper[first] - x[first] else upper[first]
        elif largest <= 1e-9:
            worst, most = -1, 1e-12
            for i in range(n):
                inwards = -gradient[i] if x[i] <= lower[i] else gradient[i]
                if held[i] and lower[i] < upper[i] and inwards > most:
                    worst, most = i, inwards
            if worst < 0:
                return iteration + 1
            held[worst] = False
    return -60


@compiled
def position_box(limits: LimitTable, q: Array, dt: float, lower: Array, upper: Array) -> None:
    """Fill the velocities from which every joint still can stop before its limit, cut with the velocity limits.

    The discrete braking bound max(0, √(2ad) - a dt/2): braking fully from it stays within the bound of the next tick,
    and short of the limit. The box always holds 0."""
    for i in range(q.shape[0]):
        a = limits.braking[i]
        down = max(0.0, math.sqrt(2.0 * a * max(0.0, q[i] - limits.lower[i])) - 0.5 * a * dt)
        up = max(0.0, math.sqrt(2.0 * a * max(0.0, limits.upper[i] - q[i])) - 0.5 * a * dt)
        lower[i], upper[i] = -min(down, limits.velocity[i]), min(up, limits.velocity[i])


@compiled
def acceleration_box(limits: LimitTable, v: Array, dt: float, lower: Array, upper: Array) -> None:
    """Cut the box to what the acceleration limit lets ``v`` reach, which wins where both cannot be had: never empty."""
    for i in range(v.shape[0]):
        slowest, fastest = v[i] - limits.acceleration[i] * dt, v[i] + limits.acceleration[i] * dt
        lower[i] = min(max(lower[i], slowest), fastest)
        upper[i] = max(min(upper[i], fastest), slowest)


@compiled
def braked(step: Array, velocity: Array, acceleration: Array, dt: float) -> float:
    """The factor ≤ 1 on a joint displacement ``step`` (n,) [rad] whose speed still can be braked to zero at its end."""
    factor = 1.0
    for i in range(step.shape[0]):
        distance, reach = abs(step[i]), acceleration[i] * dt * dt
        if distance > 0.5 * reach:
            allowed = min(velocity[i] * dt, math.sqrt(2.0 * acceleration[i] * distance) * dt - 0.5 * reach)
            factor = min(factor, allowed / distance)
    return factor
