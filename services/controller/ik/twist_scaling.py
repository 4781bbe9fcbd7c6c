"""How fast a twist can be followed from where the arm is without leaving its line: one factor for the whole of it.

A velocity that a client holds knows nothing of what lies ahead: the edge of reach, a singularity, the end of a joint's
range. Joints that meet one of these at speed cannot brake in time along the line. So the twist is slowed before:

    minimise    ½ |J v - σ t|²_W + ½ μ |v - σ q'|² + ½ w (1 - σ)²        over v and σ
    subject to  braking bound, velocity and acceleration of each joint, 0 ≤ σ ≤ 1
    and         σ ≤ √(γ a / |q''|) and the braking bound on σ q' for each joint

with q' the joint velocity for the whole twist t and q'' how q' changes along the line. The QP is a box QP in n + 1
unknowns (placo calls such a task "scaled"). What follows it looks ahead. Near the edge of reach the joints go as the
square root of what is left of the line, q ~ √d; at σ² q'' = γ a, braking along the line takes σ' q' = -1.5 γ a and the
line itself γ a, so with γ ≤ 1 the joints can do it. Where a joint comes to the end of its range, others may take over,
but not at once.
"""

from __future__ import annotations

import math

import numpy as np

from rackhand.runtime.compiled import compiled
from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik.kernels import (
    DAMPING,
    DT,
    WEIGHTS,
    acceleration_box,
    cholesky,
    cholesky_solve,
    forward,
    jacobian,
    normal_matrix,
    position_box,
    solve_box,
)

CURVATURE = 0.5  # γ: share of a joint's acceleration that following the line may take
TAKE_OVER = 0.1  # [rad/s] up to which other joints take over at once
CREEP = 5e-3  # √w [m/s, rad/s]: an error of this speed costs as much as standing still


@compiled
def rate(
    placements: Array, tuning: Array, q: Array, twist: Array, jac: Array, h: Array, body: Array, dq: Array
) -> None:
    """Fill `dq` (n,) with the joint velocity for `twist` (6,), base axes, at q; and what that takes: the Jacobian, `h`
    as `tick` has it, and the twist in the tool's axes."""
    n = q.shape[0]
    frames, factor = np.empty((n + 1, 3, 4)), np.empty((n, n))
    forward(placements, q, frames)
    jacobian(frames, jac)
    tool = frames[n]
    for r in range(3):
        body[r] = tool[0, r] * twist[0] + tool[1, r] * twist[1] + tool[2, r] * twist[2]
        body[r + 3] = tool[0, r] * twist[3] + tool[1, r] * twist[4] + tool[2, r] * twist[5]
    weights = tuning[WEIGHTS : WEIGHTS + 6]
    normal_matrix(jac, weights, tuning[DAMPING], h)
    cholesky(h, n, factor)
    dq[:] = (weights * body) @ jac
    cholesky_solve(factor, n, dq, dq)


@compiled
def pace(placements: Array, limits: Array, tuning: Array, q: Array, v: Array, twist: Array) -> float:
    """The factor 0 … 1 on `twist` (6,), base axes at the tool, from q and v (n,); see the module. `limits` and `tuning`
    as in `tick`."""
    n = q.shape[0]
    jac, h, body = np.empty((6, n)), np.empty((n, n)), np.empty(6)
    dq, ahead, behind = np.empty(n), np.empty(n), np.empty(n)
    rate(placements, tuning, q, twist, jac, h, body, dq)
    fastest = np.max(np.abs(dq))
    if fastest < 1e-12:
        return 1.0
    # Small against how fast q' itself turns, or the difference would miss it near singularities.
    e = 1e-5 / fastest
    rate(placements, tuning, q + e * dq, twist, jac, h, body, ahead)
    rate(placements, tuning, q - e * dq, twist, jac, h, body, behind)
    rate(placements, tuning, q, twist, jac, h, body, dq)
    lower, upper, x, c = np.zeros(n + 1), np.ones(n + 1), np.ones(n + 1), np.zeros(n + 1)
    position_box(limits, q, tuning[DT], lower[:n], upper[:n])
    most, at_once = 1.0, min(1.0, TAKE_OVER / fastest)
    for i in range(n):
        bend = abs(ahead[i] - behind[i]) / (2.0 * e)
        if bend > CURVATURE * limits[3, i]:
            most = min(most, math.sqrt(CURVATURE * limits[3, i] / bend))
    for i in range(n):
        brakes_from = upper[i] if dq[i] > 0.0 else -lower[i]
        if brakes_from < most * abs(dq[i]):
            most = max(brakes_from / abs(dq[i]), min(most, at_once))
    acceleration_box(limits, v, tuning[DT], lower[:n], upper[:n])
    weighted, damping = tuning[WEIGHTS : WEIGHTS + 6] * body, tuning[DAMPING]
    wide = np.empty((n + 1, n + 1))
    wide[:n, :n] = h
    wide[n, :n] = -(weighted @ jac + damping * dq)
    wide[:n, n] = wide[n, :n]
    wide[n, n] = np.sum(weighted * body) + damping * np.sum(dq * dq) + CREEP * CREEP
    c[n], upper[n], x[:n] = CREEP * CREEP, most, dq
    solve_box(wide, c, lower, upper, x)
    return float(x[n]) if x[n] < 1.0 - 1e-6 else 1.0
