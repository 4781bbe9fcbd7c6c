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
    ArmTables,
    acceleration_box,
    cholesky,
    cholesky_solve,
    forward,
    jacobian,
    normal_matrix,
    position_box,
    solve_box,
    to_tool,
)

CURVATURE = 0.5  # γ: share of a joint's acceleration that following the line may take
TAKE_OVER = 0.1  # [rad/s] up to which other joints take over at once
CREEP = 5e-3  # √w [m/s, rad/s]: an error of this speed costs as much as standing still


@compiled
def joint_rate(arm: ArmTables, q: Array, twist: Array, jac: Array, h: Array, body: Array, dq: Array) -> None:
    """Fill ``dq`` (n,) with the joint velocity for ``twist`` (6,), base axes, at ``q`` (n,); and the intermediate
    results: the Jacobian ``jac`` (6, n), ``h`` (n, n) as in ``tick``, and ``body`` (6,), the twist in tool axes."""
    n = q.shape[0]
    frames, factor = np.empty((n + 1, 3, 4)), np.empty((n, n))
    forward(arm.placements, q, frames)
    jacobian(frames, jac)
    to_tool(frames[n], twist, body)
    normal_matrix(jac, arm.tuning.weights, arm.tuning.damping, h)
    cholesky(h, n, factor)
    dq[:] = (arm.tuning.weights * body) @ jac
    cholesky_solve(factor, n, dq, dq)


@compiled
def twist_scale(arm: ArmTables, q: Array, v: Array, twist: Array) -> float:
    """The factor 0 … 1 on ``twist`` (6,), base axes at the tool, from ``q`` and ``v`` (n,); see the module."""
    n = q.shape[0]
    limits, tuning = arm.limits, arm.tuning
    jac, h, body = np.empty((6, n)), np.empty((n, n)), np.empty(6)
    dq, ahead, behind = np.empty(n), np.empty(n), np.empty(n)
    joint_rate(arm, q, twist, jac, h, body, dq)
    fastest = np.max(np.abs(dq))
    if fastest < 1e-12:
        return 1.0
    # Small against how fast q' itself turns, or the difference would miss it near singularities.
    e = 1e-5 / fastest
    joint_rate(arm, q + e * dq, twist, jac, h, body, ahead)
    joint_rate(arm, q - e * dq, twist, jac, h, body, behind)
    joint_rate(arm, q, twist, jac, h, body, dq)
    lower, upper, x, c = np.zeros(n + 1), np.ones(n + 1), np.ones(n + 1), np.zeros(n + 1)
    position_box(limits, q, tuning.dt, lower[:n], upper[:n])
    most, at_once = 1.0, min(1.0, TAKE_OVER / fastest)
    for i in range(n):
        bend = abs(ahead[i] - behind[i]) / (2.0 * e)
        if bend > CURVATURE * limits.acceleration[i]:
            most = min(most, math.sqrt(CURVATURE * limits.acceleration[i] / bend))
    for i in range(n):
        brakes_from = upper[i] if dq[i] > 0.0 else -lower[i]
        if brakes_from < most * abs(dq[i]):
            most = max(brakes_from / abs(dq[i]), min(most, at_once))
    acceleration_box(limits, v, tuning.dt, lower[:n], upper[:n])
    weighted = tuning.weights * body
    wide = np.empty((n + 1, n + 1))
    wide[:n, :n] = h
    wide[n, :n] = -(weighted @ jac + tuning.damping * dq)
    wide[:n, n] = wide[n, :n]
    wide[n, n] = np.sum(weighted * body) + tuning.damping * np.sum(dq * dq) + CREEP * CREEP
    c[n], upper[n], x[:n] = CREEP * CREEP, most, dq
    solve_box(wide, c, lower, upper, x)
    return float(x[n]) if x[n] < 1.0 - 1e-6 else 1.0
