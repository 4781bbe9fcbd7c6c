"""One control tick: from where the arm is and what is asked to the velocity of the coming period."""

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
    curve,
    forward,
    jacobian,
    lengths,
    manipulability,
    normal_matrix,
    pose_error,
    pose_gap,
)

# Entries of the vector of tuning.
DT, WEIGHTS, DAMPING, LM_DAMPING, SINGULAR_DAMPING, SINGULAR_AT, LEAP, TUNING = 0, 1, 7, 8, 9, 10, 11, 12
# Entries of what a tick reports.
SCALE, MEASURE, ERROR_LINEAR, ERROR_ANGULAR, SOLVER, ITERATIONS, REPORT = 0, 1, 2, 3, 4, 5, 6
NONE, CHOLESKY, BOX, ROWS = 0, 1, 2, 3
SETTLING = 10.0  # [1/s] how fast the arm draws near a posture that only is the nearest: it moves as the target does
LOOKS = 12  # steps of `look_ahead`
REACH = 0.01  # error left at rest [m, rad] from which the target is out of reach, and feeding its motion forward no use


@compiled
def descend(
    placements: Array, limits: Array, tuning: Array, target: Array, goal: Array, frames: Array, looks: int
) -> tuple[float, bool]:
    """Move `goal` (n,), whose `frames` are filled, to a posture with the tool at `target`, or the nearest within
    limits, by so many steps at most. Returns the error left and whether it came to an end.

    Gauss and Newton's method where the target seems in reach, which moves a redundant arm no further than it must; else
    Newton's, which converges fast also where an error remains. Damped where the error is not convex, or a step gains
    less than it promised."""
    n = goal.shape[0]
    weights = tuning[WEIGHTS : WEIGHTS + 6]
    error, jac, h, factor = np.empty(6), np.empty((6, n)), np.empty((n, n)), np.empty((n, n))
    c, low, high, step, trial = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(6)
    least, damping = pose_gap(frames[n], target, weights, error), 0.0
    for _ in range(looks):
        jacobian(frames, jac)
        c[:] = (weights * error) @ jac
        normal_matrix(jac, weights, tuning[DAMPING], h)
        cholesky(h, n, factor)
        cholesky_solve(factor, n, c, step)
        if np.sum(c * step) < 0.5 * least:  # out of reach, for all that first derivatives tell
            curve(jac, weights[:3] * error[:3], h)
        added = 0.0
        while True:
            for i in range(n):
                h[i, i] += damping - added
            if cholesky(h, n, factor) > 0.5 * tuning[DAMPING] or damping > 1e3:
                break
            added, damping = damping, max(4.0 * damping, 1e-3)
        for i in range(n):
            low[i], high[i], step[i] = limits[0, i] - goal[i], limits[1, i] - goal[i], 0.0
        solve_box(h, c, low, high, step)
        length, undamped = np.max(np.abs(step)), damping == 0.0
        if length < 1e-5:
            return math.sqrt(least), True
        predicted = np.sum(step * (2.0 * c - h @ step + damping * step))
        forward(placements, goal + step, frames)
        squared = pose_gap(frames[n], target, weights, trial)
        if least - squared > 0.75 * predicted:
            damping *= 0.25
        elif least - squared < 0.25 * predicted:
            damping = max(4.0 * damping, 1e-3)
        if squared < least:
            goal += step
            error[:], least = trial, squared
            if undamped and length < 1e-3:  # what Newton leaves is the square of that
                return math.sqrt(least), True
        else:
            forward(placements, goal, frames)
    return math.sqrt(least), False


@compiled
def draw(q: Array, posture: Array, rate: float) -> Array:
    """The velocity (n,) towards a posture of which NaN leaves a joint free."""
    velocity = np.empty(q.shape[0])
    for i in range(q.shape[0]):
        velocity[i] = 0.0 if math.isnan(posture[i]) else rate * (posture[i] - q[i])
    return velocity


@compiled
def look_ahead(
    placements: Array, limits: Array, tuning: Array, q: Array, frames: Array, target: Array, goals: Array
) -> float:
    """Move `goals[0]` (n,), that of the tick before or NaN, to where the joints will come to rest: at `target`, or at
    the posture nearest to it when it is out of reach. Returns the error that remains there.

    Braking has to know the whole way: along a curved one, a single Newton step is off by a quarter; towards a target
    out of reach it overshoots from one side of the singularity to the other, for ever. Starts from the old goal unless
    the arm itself is nearer; where that leads nowhere, home may lead to the target."""
    ahead, gap = np.empty(frames.shape), np.empty(6)
    weights, goal, other = tuning[WEIGHTS : WEIGHTS + 6], goals[0], goals[1]
    forward(placements, goal, ahead)
    if not pose_gap(ahead[-1], target, weights, gap) < pose_gap(frames[-1], target, weights, gap):  # or NaN
        goal[:], ahead[:] = q, frames
    remains, _ = descend(placements, limits, tuning, target, goal, ahead, LOOKS)
    if remains > REACH:
        if not math.isfinite(other[0]):
            other[:] = limits[4]
        forward(placements, other, ahead)
        beside, ended = descend(placements, limits, tuning, target, other, ahead, 1)
        if beside < 0.5 * remains:
            goal[:] = other
            remains, ended = descend(placements, limits, tuning, target, goal, ahead, LOOKS)
        if ended:
            other[:] = np.nan
    return remains


@compiled
def tick(
    placements: Array,
    limits: Array,
    tuning: Array,
    wish: Array,
    q: Array,
    v: Array,
    target: Array,
    twist: Array,
    goals: Array,
    frames: Array,
    h: Array,
    box: Array,
    out: Array,
    report: Array,
) -> None:
    """One control tick without collision rows: fill `out` (n,) with the joint velocity for the coming period.

    `target` (3, 4) is where the tool ought to be now, `twist` (6,) how the target moves in the coming period (axes of
    the base, point at the tool). `wish` (n,) is the joint velocity that the objectives ask for; they get what the
    task leaves over; `goals` (2, n) is kept from tick to tick. Fills `frames`, the QP min ½vᵀHv - cᵀv with H in `h`,
    bounds in `box[0]` and `box[1]`, c in `box[2]`, and `report`. Input that is not finite brakes. In three steps:

    1. The velocity wished for: k step/dt + flow + idle. `step` leads to the target, k ≤ 1 is what can be braked in
       time, `flow` feeds the target's motion forward. One factor slows both where a joint would exceed its velocity
       limit, as near a singularity: the direction stays.
    2. From the present velocity straight towards that, as far as the acceleration limits allow: the direction stays.
    3. If that lies outside the box, the point of the box with the least task error, that is in the metric of H."""
    if not math.isfinite(np.sum(q) + np.sum(v) + np.sum(target) + np.sum(twist) + np.sum(wish)):
        for i in range(v.shape[0]):
            change = limits[3, i] * tuning[DT]
            out[i] = min(max(0.0, v[i] - change), v[i] + change) if math.isfinite(v[i]) else 0.0
        report[:] = np.nan
        report[SOLVER], report[ITERATIONS] = NONE, 0
        return
    n = q.shape[0]
    dt, weights = tuning[DT], tuning[WEIGHTS : WEIGHTS + 6]
    jac, error, feed = np.empty((6, n)), np.empty(6), np.empty(6)
    factor, step, flow, idle = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n)
    lower, upper, c = box[0], box[1], box[2]
    forward(placements, q, frames)
    jacobian(frames, jac)
    tool = frames[n]
    squared = pose_error(tool, target, weights, error)
    measure = manipulability(jac)
    damping = tuning[DAMPING] + tuning[LM_DAMPING] * squared
    if measure < tuning[SINGULAR_AT]:
        damping += tuning[SINGULAR_DAMPING] * (1.0 - measure / tuning[SINGULAR_AT]) ** 2
    normal_matrix(jac, weights, damping, h)
    cholesky(h, n, factor)
    step[:] = (weights * error) @ jac
    cholesky_solve(factor, n, step, step)
    scale, reach = braked(step, limits[2], limits[3], dt), 1.0
    if scale < 1.0 or np.max(np.abs(error - jac @ step)) > 0.1 * REACH:
        remains = look_ahead(placements, limits, tuning, q, frames, target, goals)
        if np.max(np.abs(goals[0] - q)) <= tuning[LEAP]:
            step[:] = goals[0] - q
            reach = max(0.0, 1.0 - remains / REACH)
            scale = min(braked(step, limits[2], limits[3], dt), reach + (1.0 - reach) * SETTLING * dt)
    for r in range(3):
        feed[r] = tool[0, r] * twist[0] + tool[1, r] * twist[1] + tool[2, r] * twist[2]
        feed[r + 3] = tool[0, r] * twist[3] + tool[1, r] * twist[4] + tool[2, r] * twist[5]
    flow[:] = (weights * feed) @ jac
    cholesky_solve(factor, n, flow, flow)
    for i in range(n):
        idle[i] = tuning[DAMPING] * min(max(wish[i], -limits[2, i]), limits[2, i])
    cholesky_solve(factor, n, idle, idle)
    slow = 1.0
    for i in range(n):
        flow[i] = reach * flow[i] + scale / dt * step[i]
        slow = min(slow, limits[2, i] / max(abs(flow[i]), 1e-12))
    position_box(limits, q, dt, lower, upper)
    part = 1.0
    for i in range(n):
        flow[i] = slow * flow[i] + idle[i]
        change = min(max(flow[i], lower[i]), upper[i]) - v[i]
        part = min(part, limits[3, i] * dt / max(abs(change), 1e-12))
    acceleration_box(limits, v, dt, lower, upper)
    solver, iterations = CHOLESKY, 1
    for i in range(n):
        out[i] = v[i] + part * (flow[i] - v[i])
        if out[i] < lower[i] - 1e-12 or out[i] > upper[i] + 1e-12:
            solver = BOX
    c[:] = h @ out
    if solver == BOX:
        iterations = abs(solve_box(h, c, lower, upper, out))
    for i in range(n):
        out[i] = min(max(out[i], lower[i]), upper[i])
    report[SCALE], report[MEASURE], report[SOLVER] = slow * scale * part, measure, solver
    report[ITERATIONS] = iterations
    report[ERROR_LINEAR], report[ERROR_ANGULAR] = lengths(error)
