"""Time-optimal path parametrisation by reachability analysis (TOPP-RA; Pham & Pham, T-RO 2018).

Along a grid of s, x = ṡ² and u = s̈ are constrained by x ≤ ceiling and by rows |A u + B x| ≤ c. The rows are kept at
both ends of every interval, where x has grown by 2hu. Since rest (u = x = 0) satisfies every row, the set of x from
which the rest of the path can be driven is an interval [0, β], and the two-variable linear program for β is solved
exactly by Newton's method on the concave, piecewise linear width of the interval of u.

All arrays: ``s`` (N,), ``A``, ``B`` (N, m) rows over their limits, ``c`` (N,) the share of the limits to be used.
"""

from __future__ import annotations

import numpy as np

from rackhand.runtime.compiled import compiled
from rackhand.schemas.arrays import Array

_TINY = 1e-12


@compiled
def _cut(a: float, b: float, c: float, x: float, box: Array) -> None:
    """Narrows ``box`` = [low, its slope by x, high, its slope, ceiling of x] by |a u + b x| ≤ c."""
    if abs(a) < _TINY:
        if abs(b) * box[4] > c:
            box[4] = c / abs(b)
        return
    slope = -b / a
    half = c / abs(a)
    if slope * x - half > box[0]:
        box[0] = slope * x - half
        box[1] = slope
    if slope * x + half < box[2]:
        box[2] = slope * x + half
        box[3] = slope


@compiled
def _accelerations(A: Array, B: Array, c: Array, i: int, h: float, x: float, box: Array) -> None:
    """The interval of u at x that the rows at both ends of interval i leave, into ``box``."""
    box[0], box[1], box[2], box[3], box[4] = -np.inf, 0.0, np.inf, 0.0, np.inf
    for j in range(A.shape[1]):
        _cut(A[i, j], B[i, j], c[i], x, box)
        _cut(A[i + 1, j] + 2 * h * B[i + 1, j], B[i + 1, j], c[i + 1], x, box)


@compiled
def controllable(s: Array, A: Array, B: Array, c: Array, ceiling: Array) -> Array:
    """β (N,): the largest x at every grid point from which the path can be finished. The path ends at ceiling[-1]."""
    n = s.size
    beta = np.empty(n)
    beta[n - 1] = ceiling[n - 1]
    box = np.empty(5)
    for i in range(n - 2, -1, -1):
        h = s[i + 1] - s[i]
        if h <= 0:
            beta[i] = min(ceiling[i], beta[i + 1])
            continue
        x = ceiling[i]
        for _ in range(50):
            _accelerations(A, B, c, i, h, x, box)
            if box[4] < x:
                x = box[4]
                continue
            if -x / (2 * h) > box[0]:
                box[0], box[1] = -x / (2 * h), -1 / (2 * h)
            if (beta[i + 1] - x) / (2 * h) < box[2]:
                box[2], box[3] = (beta[i + 1] - x) / (2 * h), -1 / (2 * h)
            gap = box[0] - box[2]
            if gap <= 1e-10 * (1.0 + abs(box[0])):
                break
            shrink = box[1] - box[3]
            x = x - gap / shrink if shrink > 0 else 0.0
            x = max(x, 0.0)
        beta[i] = x
    return beta


@compiled
def drive(
    s: Array, A: Array, B: Array, c: Array, beta: Array, x0: float, reserve: float, braking: bool
) -> tuple[Array, Array, float]:
    """From x0 on as fast as β allows, or, ``braking``, down to rest as soon as the rows allow.

    Where x is above β it is brought down as fast as the rows allow with ``reserve`` added to c.
    Returns x (N,), u (N-1,), and the s where x reaches 0 (the last s if it does not before).
    """
    n = s.size
    x, u = np.zeros(n), np.zeros(n - 1)
    x[0] = x0
    box = np.empty(5)
    for i in range(n - 1):
        h = s[i + 1] - s[i]
        if h <= 0:
            x[i + 1] = x[i]
            continue
        _accelerations(A, B, c, i, h, x[i], box)
        if not braking:
            u[i] = min(box[2], (beta[i + 1] - x[i]) / (2 * h))
        if braking or box[0] > box[2]:
            u[i] = box[0] if box[0] < box[2] else (box[0] + box[2]) / 2
        elif u[i] < box[0]:
            _accelerations(A, B, c + reserve, i, h, x[i], box)
            u[i] = max(u[i], box[0])
        x[i + 1] = x[i] + 2 * h * u[i]
        if braking and x[i + 1] <= 0:
            x[i + 1] = 0.0
            return x, u, min(s[i] - (x[i] / (2 * u[i]) if u[i] < 0 else 0.0), s[i + 1])
        x[i + 1] = max(x[i + 1], 0.0)
    return x, u, s[n - 1]
