"""The arithmetic of inverse kinematics: a serial chain, joint limits as a box, the box QP, one control tick, pose
search.

Compiled by numba; with its cache, a start costs nothing. All of it is in one file because numba's cache notices a
change only in the file of the function it compiled, not in what that calls. `NUMBA_DISABLE_JIT=1` runs it as plain
Python.

Shapes: n joints; a pose is (3, 4) = [R | p]; twists are (linear, angular), of the tool in its own axes unless said.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

# Entries of the vector of tuning.
DT, WEIGHTS, DAMPING, LM_DAMPING, SINGULAR_DAMPING, SINGULAR_AT, LEAP, TUNING = 0, 1, 7, 8, 9, 10, 11, 12
# Entries of what a tick reports.
SCALE, MEASURE, ERROR_LINEAR, ERROR_ANGULAR, SOLVER, ITERATIONS, REPORT = 0, 1, 2, 3, 4, 5, 6
NONE, CHOLESKY, BOX, ROWS = 0, 1, 2, 3
SETTLING = 10.0  # [1/s] how fast the arm draws near a posture that only is the nearest: it moves as the target does
LOOKS = 12  # steps of `look_ahead`
PROJECTED = 12  # steps of projected Newton, which seldom takes more than six
REACH = 0.01  # error left at rest [m, rad] from which the target is out of reach, and feeding its motion forward no use


@njit(cache=True)
def forward(placements, q, frames):  # type: ignore[no-untyped-def]
    """Fill `frames` (n+1, 3, 4): pose of every joint (turned by q) and of the tool in the base frame."""
    n = q.shape[0]
    for i in range(n + 1):
        m, f = placements[i], frames[i]
        if i == 0:
            f[:] = m
        else:
            g = frames[i - 1]
            for r in range(3):
                for c in range(4):
                    f[r, c] = g[r, 0] * m[0, c] + g[r, 1] * m[1, c] + g[r, 2] * m[2, c]
                f[r, 3] += g[r, 3]
        if i < n:
            cos, sin = math.cos(q[i]), math.sin(q[i])
            for r in range(3):
                a, b = f[r, 0], f[r, 1]
                f[r, 0], f[r, 1] = cos * a + sin * b, cos * b - sin * a


@njit(cache=True)
def jacobian(frames, jac):  # type: ignore[no-untyped-def]
    """Fill `jac` (6, n): tool twist in its own axes by joint velocity, as pinocchio's LOCAL frame Jacobian."""
    n = jac.shape[1]
    t = frames[n]
    for k in range(n):
        f = frames[k]
        ax, ay, az = f[0, 2], f[1, 2], f[2, 2]
        x, y, z = t[0, 3] - f[0, 3], t[1, 3] - f[1, 3], t[2, 3] - f[2, 3]
        lx, ly, lz = ay * z - az * y, az * x - ax * z, ax * y - ay * x
        for r in range(3):
            jac[r, k] = t[0, r] * lx + t[1, r] * ly + t[2, r] * lz
            jac[r + 3, k] = t[0, r] * ax + t[1, r] * ay + t[2, r] * az


@njit(cache=True)
def pose_gap(pose, target, weights, gap):  # type: ignore[no-untyped-def]
    """Fill `gap` (6,): offset of the target's origin and log3 of its rotation, both seen in the pose. Returns gapᵀ W
    gap, whose slope along a body twist is -2 W gap (equal weights within each part). By way of the quaternion
    (Shepperd's method), which keeps its digits at half a turn."""
    r = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            r[i, j] = pose[0, i] * target[0, j] + pose[1, i] * target[1, j] + pose[2, i] * target[2, j]
    px, py, pz = target[0, 3] - pose[0, 3], target[1, 3] - pose[1, 3], target[2, 3] - pose[2, 3]
    x = pose[0, 0] * px + pose[1, 0] * py + pose[2, 0] * pz
    y = pose[0, 1] * px + pose[1, 1] * py + pose[2, 1] * pz
    z = pose[0, 2] * px + pose[1, 2] * py + pose[2, 2] * pz
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    if trace > 0.0:
        qw = trace + 1.0
        qx, qy, qz = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    elif r[0, 0] >= r[1, 1] and r[0, 0] >= r[2, 2]:
        qx = 1.0 + r[0, 0] - r[1, 1] - r[2, 2]
        qw, qy, qz = r[2, 1] - r[1, 2], r[1, 0] + r[0, 1], r[0, 2] + r[2, 0]
    elif r[1, 1] >= r[2, 2]:
        qy = 1.0 + r[1, 1] - r[0, 0] - r[2, 2]
        qw, qx, qz = r[0, 2] - r[2, 0], r[1, 0] + r[0, 1], r[2, 1] + r[1, 2]
    else:
        qz = 1.0 + r[2, 2] - r[0, 0] - r[1, 1]
        qw, qx, qy = r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[2, 1] + r[1, 2]
    if qw < 0.0:
        qw, qx, qy, qz = -qw, -qx, -qy, -qz
    length = math.sqrt(qx * qx + qy * qy + qz * qz)
    by = 2.0 * math.atan2(length, qw) / length if length > 1e-12 else 2.0 / qw
    gap[0], gap[1], gap[2] = x, y, z
    gap[3], gap[4], gap[5] = by * qx, by * qy, by * qz
    return weighted(weights, gap)


@njit(cache=True)
def weighted(weights, error):  # type: ignore[no-untyped-def]
    """errorᵀ W error."""
    total = 0.0
    for i in range(6):
        total += weights[i] * error[i] * error[i]
    return total


@njit(cache=True)
def pose_error(pose, target, weights, error):  # type: ignore[no-untyped-def]
    """Fill `error` (6,) with log6(pose⁻¹ target), the body twist that leads from pose to target in unit time.
    Returns errorᵀ W error."""
    pose_gap(pose, target, weights, error)
    x, y, z, wx, wy, wz = error[0], error[1], error[2], error[3], error[4], error[5]
    angle = math.sqrt(wx * wx + wy * wy + wz * wz)
    # V⁻¹ p = p - ½ w×p + b w×(w×p)
    b = (1.0 - 0.5 * angle / math.tan(0.5 * angle)) / (angle * angle) if angle > 1e-4 else 1.0 / 12.0
    cx, cy, cz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
    error[0] = x - 0.5 * cx + b * (wy * cz - wz * cy)
    error[1] = y - 0.5 * cy + b * (wz * cx - wx * cz)
    error[2] = z - 0.5 * cz + b * (wx * cy - wy * cx)
    return weighted(weights, error)


@njit(cache=True)
def lengths(twist):  # type: ignore[no-untyped-def]
    """Of the linear and the angular part."""
    return math.sqrt(np.sum(twist[:3] ** 2)), math.sqrt(np.sum(twist[3:] ** 2))


@njit(cache=True)
def cholesky(h, size, factor):  # type: ignore[no-untyped-def]
    """Lower factor of the leading `size` rows of positive definite `h`. Returns the least pivot."""
    least = np.inf
    for i in range(size):
        for j in range(i + 1):
            total = h[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(max(total, 1e-300)) if i == j else total / factor[j, j]
        least = min(least, total)
    return least


@njit(cache=True)
def cholesky_solve(factor, size, b, x):  # type: ignore[no-untyped-def]
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


@njit(cache=True)
def solve_box(h, c, lower, upper, x):  # type: ignore[no-untyped-def]
    """min ½ xᵀHx - cᵀx within the box, H positive definite: exact to rounding. Starts at `x`, leaves the solution
    there. Projected Newton (Bertsekas 1982): Newton's step on the free coordinates, cut to the box, with Armijo's rule.
    Where that zigzags between faces of the box, which badly conditioned H make it do, `walk_faces` takes over.

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


@njit(cache=True)
def walk_faces(h, c, lower, upper, x):  # type: ignore[no-untyped-def]
    """`solve_box` by the primal active-set method (Nocedal & Wright 2006, §16.5): to the minimum of a face of the box
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


@njit(cache=True)
def position_box(limits, q, dt, lower, upper):  # type: ignore[no-untyped-def]
    """Fill the velocities from which every joint still can stop before its limit, cut with the velocity limits.

    `limits` as `servo.limit_table` makes them. The discrete braking bound max(0, √(2ad) - a dt/2): braking fully from
    it stays within the bound of the next tick, and short of the limit. The box always holds 0."""
    for i in range(q.shape[0]):
        a = limits[5, i]
        down = max(0.0, math.sqrt(2.0 * a * max(0.0, q[i] - limits[0, i])) - 0.5 * a * dt)
        up = max(0.0, math.sqrt(2.0 * a * max(0.0, limits[1, i] - q[i])) - 0.5 * a * dt)
        lower[i], upper[i] = -min(down, limits[2, i]), min(up, limits[2, i])


@njit(cache=True)
def acceleration_box(limits, v, dt, lower, upper):  # type: ignore[no-untyped-def]
    """Cut the box to what the acceleration limit lets `v` reach, which wins where both cannot be had: never empty."""
    for i in range(v.shape[0]):
        slowest, fastest = v[i] - limits[3, i] * dt, v[i] + limits[3, i] * dt
        lower[i] = min(max(lower[i], slowest), fastest)
        upper[i] = max(min(upper[i], fastest), slowest)


@njit(cache=True)
def manipulability(jac):  # type: ignore[no-untyped-def]
    """√det(J Jᵀ) (Yoshikawa 1985)."""
    square, factor = np.empty((6, 6)), np.empty((6, 6))
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(jac.shape[1]):
                total += jac[i, k] * jac[j, k]
            square[i, j] = total
        square[i, i] += 1e-16
    cholesky(square, 6, factor)
    measure = 1.0
    for i in range(6):
        measure *= factor[i, i]
    return measure


@njit(cache=True)
def braked(step, velocity, acceleration, dt):  # type: ignore[no-untyped-def]
    """The factor ≤ 1 on a joint displacement `step` [rad] whose speed still can be braked to zero at its end."""
    factor = 1.0
    for i in range(step.shape[0]):
        distance, reach = abs(step[i]), acceleration[i] * dt * dt
        if distance > 0.5 * reach:
            allowed = min(velocity[i] * dt, math.sqrt(2.0 * acceleration[i] * distance) * dt - 0.5 * reach)
            factor = min(factor, allowed / distance)
    return factor


@njit(cache=True)
def normal_matrix(jac, weights, damping, h):  # type: ignore[no-untyped-def]
    """Fill h = Jᵀ W J + damping I."""
    n = jac.shape[1]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for r in range(6):
                total += weights[r] * jac[r, i] * jac[r, j]
            h[i, j] = h[j, i] = total
        h[i, i] += damping


@njit(cache=True)
def curve(jac, pull, h):  # type: ignore[no-untyped-def]
    """Take off `h` (n, n) the second derivatives of the tool's position along `pull` (3,), both in the tool's axes:
    pull·∂²p/∂q_i∂q_j = pull·(ω_i × v_j) for i ≤ j."""
    n = jac.shape[1]
    for i in range(n):
        x = pull[1] * jac[5, i] - pull[2] * jac[4, i]
        y = pull[2] * jac[3, i] - pull[0] * jac[5, i]
        z = pull[0] * jac[4, i] - pull[1] * jac[3, i]
        for j in range(i, n):
            h[j, i] -= x * jac[0, j] + y * jac[1, j] + z * jac[2, j]
            h[i, j] = h[j, i]


@njit(cache=True)
def descend(placements, limits, tuning, target, goal, frames, looks):  # type: ignore[no-untyped-def]
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


@njit(cache=True)
def draw(q, posture, rate):  # type: ignore[no-untyped-def]
    """The velocity (n,) towards a posture of which NaN leaves a joint free."""
    velocity = np.empty(q.shape[0])
    for i in range(q.shape[0]):
        velocity[i] = 0.0 if math.isnan(posture[i]) else rate * (posture[i] - q[i])
    return velocity


@njit(cache=True)
def look_ahead(placements, limits, tuning, q, frames, target, goals):  # type: ignore[no-untyped-def]
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


@njit(cache=True)
def tick(placements, limits, tuning, wish, q, v, target, twist, goals, frames, h, box, out, report):  # type: ignore[no-untyped-def]
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


@njit(cache=True)
def search(placements, limits, weights, q, target, tolerance, iterations):  # type: ignore[no-untyped-def]
    """Move `q` (n,) to where the tool is at `target` within `tolerance` (linear [m], angular [rad]), joints within
    limits.

    Levenberg-Marquardt whose step is a box QP, at most a radian a joint; gives up when ten steps gain less than a
    tenth. Returns whether it arrived and the number of steps; `q` is the best found."""
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
            low[i], high[i] = max(limits[0, i] - q[i], -1.0), min(limits[1, i] - q[i], 1.0)
            step[i] = 0.0
        solve_box(h, c, low, high, step)
        for i in range(n):
            q[i] += step[i]
            if iteration % 5 == 4:  # against its limit: the same pose a turn away, where there is room
                if q[i] >= limits[1, i] and q[i] - 2.0 * math.pi > limits[0, i]:
                    q[i] -= 2.0 * math.pi
                elif q[i] <= limits[0, i] and q[i] + 2.0 * math.pi < limits[1, i]:
                    q[i] += 2.0 * math.pi
    q[:] = best
    return False, iteration + 1


@njit(cache=True)
def nearest(placements, weights, seeds, target):  # type: ignore[no-untyped-def]
    """Index of the row of `seeds` (m, n) that has the tool closest to `target`."""
    n = seeds.shape[1]
    frames, error = np.empty((n + 1, 3, 4)), np.empty(6)
    best, least = 0, np.inf
    for i in range(seeds.shape[0]):
        forward(placements, seeds[i], frames)
        squared = pose_error(frames[n], target, weights, error)
        if squared < least:
            best, least = i, squared
    return best
