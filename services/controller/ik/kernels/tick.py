"""One control tick: from the state of the arm and the target to the velocity of the coming period."""

from __future__ import annotations

import math

import numpy as np

from rackhand.runtime.compiled import compiled
from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik.kernels.box import (
    acceleration_box,
    braked,
    cholesky,
    cholesky_solve,
    position_box,
    solve_box,
)
from rackhand.services.controller.ik.kernels.chain import (
    forward,
    jacobian,
    lengths,
    manipulability,
    normal_matrix,
    pose_error,
    pose_gap,
    subtract_curvature,
    to_tool,
)
from rackhand.services.controller.ik.kernels.tables import (
    BOX,
    CHOLESKY,
    ERROR_ANGULAR,
    ERROR_LINEAR,
    ITERATIONS,
    MEASURE,
    NONE,
    SCALE,
    SOLVER,
    ArmTables,
    TickWork,
)

SETTLING = 10.0  # [1/s] rate of approach to a posture that is only the nearest: it moves as the target does
NEWTON_STEPS = 12  # of ``look_ahead``
REACH = 0.01  # error left at rest [m, rad] from which the target is out of reach, and feed-forward of no use


@compiled
def newton_solve(arm: ArmTables, target: Array, goal: Array, frames: Array, steps: int) -> tuple[float, bool]:
    """Move ``goal`` (n,), whose ``frames`` are filled, to a posture with the tool at ``target``, or the nearest within
    limits, by so many ``steps`` at most. Returns the error left and whether it converged.

    Gauss and Newton's method where the target seems in reach, which moves a redundant arm no further than it must; else
    Newton's, which converges fast also where an error remains. Damped where the error is not convex, or a step gains
    less than it promised."""
    n = goal.shape[0]
    weights, limits = arm.tuning.weights, arm.limits
    error, jac, h, factor = np.empty(6), np.empty((6, n)), np.empty((n, n)), np.empty((n, n))
    c, low, high, step, trial = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(6)
    least, damping = pose_gap(frames[n], target, weights, error), 0.0
    for _ in range(steps):
        jacobian(frames, jac)
        c[:] = (weights * error) @ jac
        normal_matrix(jac, weights, arm.tuning.damping, h)
        cholesky(h, n, factor)
        cholesky_solve(factor, n, c, step)
        if np.sum(c * step) < 0.5 * least:  # out of reach, as far as first derivatives show
            subtract_curvature(jac, weights[:3] * error[:3], h)
        added = 0.0
        while True:
            for i in range(n):
                h[i, i] += damping - added
            if cholesky(h, n, factor) > 0.5 * arm.tuning.damping or damping > 1e3:
                break
            added, damping = damping, max(4.0 * damping, 1e-3)
        for i in range(n):
            low[i], high[i], step[i] = limits.lower[i] - goal[i], limits.upper[i] - goal[i], 0.0
        solve_box(h, c, low, high, step)
        length, undamped = np.max(np.abs(step)), damping == 0.0
        if length < 1e-5:
            return math.sqrt(least), True
        predicted = np.sum(step * (2.0 * c - h @ step + damping * step))
        forward(arm.placements, goal + step, frames)
        squared = pose_gap(frames[n], target, weights, trial)
        if least - squared > 0.75 * predicted:
            damping *= 0.25
        elif least - squared < 0.25 * predicted:
            damping = max(4.0 * damping, 1e-3)
        if squared < least:
            goal += step
            error[:], least = trial, squared
            if undamped and length < 1e-3:  # the error that Newton's method leaves is the square of that
                return math.sqrt(least), True
        else:
            forward(arm.placements, goal, frames)
    return math.sqrt(least), False


@compiled
def posture_velocity(q: Array, posture: Array, rate: float) -> Array:
    """The velocity (n,) [rad/s] towards ``posture`` (n,) at ``rate`` [1/s]; NaN in the posture leaves a joint free."""
    velocity = np.empty(q.shape[0])
    for i in range(q.shape[0]):
        velocity[i] = 0.0 if math.isnan(posture[i]) else rate * (posture[i] - q[i])
    return velocity


@compiled
def look_ahead(arm: ArmTables, q: Array, frames: Array, target: Array, goals: Array) -> float:
    """Move ``goals[0]`` (n,), that of the tick before or NaN, to where the joints will come to rest: at ``target``, or
    at the posture nearest to it when it is out of reach. Returns the error that remains there.

    Braking depends on the whole remaining motion: on a curved one, a single Newton step is off by a quarter; towards a
    target out of reach it overshoots from one side of the singularity to the other, for ever. Starts from the old goal
    unless the arm itself is nearer; where that does not lead to the target, a start from home may."""
    ahead, gap = np.empty(frames.shape), np.empty(6)
    weights, goal, other = arm.tuning.weights, goals[0], goals[1]
    forward(arm.placements, goal, ahead)
    if not pose_gap(ahead[-1], target, weights, gap) < pose_gap(frames[-1], target, weights, gap):  # or NaN
        goal[:], ahead[:] = q, frames
    remains, _ = newton_solve(arm, target, goal, ahead, NEWTON_STEPS)
    if remains > REACH:
        if not math.isfinite(other[0]):
            other[:] = arm.limits.home
        forward(arm.placements, other, ahead)
        beside, ended = newton_solve(arm, target, other, ahead, 1)
        if beside < 0.5 * remains:
            goal[:] = other
            remains, ended = newton_solve(arm, target, goal, ahead, NEWTON_STEPS)
        if ended:
            other[:] = np.nan
    return remains


@compiled
def brake_only(arm: ArmTables, v: Array, work: TickWork) -> None:
    """For input that is not finite: the velocity nearest to 0 that the acceleration limits allow."""
    for i in range(v.shape[0]):
        change = arm.limits.acceleration[i] * arm.tuning.dt
        work.velocity[i] = min(max(0.0, v[i] - change), v[i] + change) if math.isfinite(v[i]) else 0.0
    work.report[:] = np.nan
    work.report[SOLVER], work.report[ITERATIONS] = NONE, 0


@compiled
def secondary_velocity_term(arm: ArmTables, secondary: Array, factor: Array, out: Array) -> None:
    """Fill ``out`` (n,) with H⁻¹ μ g: what the task leaves of the joint velocity g = ``secondary`` (n,). ``factor`` is
    the Cholesky factor of H."""
    for i in range(secondary.shape[0]):
        out[i] = arm.tuning.damping * min(max(secondary[i], -arm.limits.velocity[i]), arm.limits.velocity[i])
    cholesky_solve(factor, secondary.shape[0], out, out)


@compiled
def limited_velocity(arm: ArmTables, v: Array, wanted: Array, part: float, work: TickWork) -> None:
    """Fill ``work.velocity`` with ``v`` moved by ``part`` towards ``wanted`` (n,) or, where that is outside the box,
    with the point of the box that costs least in the metric of H. The box is cut to the acceleration limits first."""
    out, lower, upper, c = work.velocity, work.box[0], work.box[1], work.box[2]
    acceleration_box(arm.limits, v, arm.tuning.dt, lower, upper)
    solver, iterations = CHOLESKY, 1
    for i in range(v.shape[0]):
        out[i] = v[i] + part * (wanted[i] - v[i])
        if out[i] < lower[i] - 1e-12 or out[i] > upper[i] + 1e-12:
            solver = BOX
    c[:] = work.h @ out
    if solver == BOX:
        iterations = abs(solve_box(work.h, c, lower, upper, out))
    for i in range(v.shape[0]):
        out[i] = min(max(out[i], lower[i]), upper[i])
    work.report[SOLVER], work.report[ITERATIONS] = solver, iterations


@compiled
def tick(arm: ArmTables, q: Array, v: Array, target: Array, twist: Array, secondary: Array, work: TickWork) -> None:
    """One control tick without collision rows: fill ``work.velocity`` (n,) with the joint velocity for the coming
    period, and the rest of ``work`` as ``TickWork`` describes it.

    ``target`` (3, 4) is the tool's target now, ``twist`` (6,) how the target moves in the coming period (axes of the
    base, point at the tool). ``secondary`` (n,) is the joint velocity that the objectives ask for; they get what the
    task leaves over. Input that is not finite brakes. In three steps:

    1. The wanted velocity: k step/dt + feed-forward + null-space term. ``step`` leads to the target, k ≤ 1 is what can
       be braked in time, the feed-forward follows the target's motion. One factor slows both where a joint would exceed
       its velocity limit, as near a singularity: the direction stays.
    2. From the present velocity straight towards that, as far as the acceleration limits allow: the direction stays.
    3. If that lies outside the box, the point of the box with the least task error, that is in the metric of H."""
    if not math.isfinite(np.sum(q) + np.sum(v) + np.sum(target) + np.sum(twist) + np.sum(secondary)):
        brake_only(arm, v, work)
        return
    n = q.shape[0]
    limits, tuning, frames, h, report = arm.limits, arm.tuning, work.frames, work.h, work.report
    dt, weights = tuning.dt, tuning.weights
    jac, error, feed = np.empty((6, n)), np.empty(6), np.empty(6)
    factor, step, wanted, null = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n)
    lower, upper = work.box[0], work.box[1]
    forward(arm.placements, q, frames)
    jacobian(frames, jac)
    tool = frames[n]
    squared = pose_error(tool, target, weights, error)
    measure = manipulability(jac)
    damping = tuning.damping + tuning.far_damping * squared
    if measure < tuning.singular_at:
        damping += tuning.singular_damping * (1.0 - measure / tuning.singular_at) ** 2
    normal_matrix(jac, weights, damping, h)
    cholesky(h, n, factor)
    step[:] = (weights * error) @ jac
    cholesky_solve(factor, n, step, step)
    scale, reach = braked(step, limits.velocity, limits.acceleration, dt), 1.0
    if scale < 1.0 or np.max(np.abs(error - jac @ step)) > 0.1 * REACH:
        remains = look_ahead(arm, q, frames, target, work.goals)
        if np.max(np.abs(work.goals[0] - q)) <= tuning.leap:
            step[:] = work.goals[0] - q
            reach = max(0.0, 1.0 - remains / REACH)
            scale = min(braked(step, limits.velocity, limits.acceleration, dt), reach + (1.0 - reach) * SETTLING * dt)
    to_tool(tool, twist, feed)
    wanted[:] = (weights * feed) @ jac
    cholesky_solve(factor, n, wanted, wanted)
    secondary_velocity_term(arm, secondary, factor, null)
    slow = 1.0
    for i in range(n):
        wanted[i] = reach * wanted[i] + scale / dt * step[i]
        slow = min(slow, limits.velocity[i] / max(abs(wanted[i]), 1e-12))
    position_box(limits, q, dt, lower, upper)
    part = 1.0
    for i in range(n):
        wanted[i] = slow * wanted[i] + null[i]
        change = min(max(wanted[i], lower[i]), upper[i]) - v[i]
        part = min(part, limits.acceleration[i] * dt / max(abs(change), 1e-12))
    limited_velocity(arm, v, wanted, part, work)
    report[SCALE], report[MEASURE] = slow * scale * part, measure
    report[ERROR_LINEAR], report[ERROR_ANGULAR] = lengths(error)
