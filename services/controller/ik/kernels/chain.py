"""A serial chain: where its tool is, how that changes, how far it is from a target."""

from __future__ import annotations

import math

import numpy as np

from rackhand.runtime.compiled import compiled
from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik.kernels.box import cholesky


@compiled
def forward(placements: Array, q: Array, frames: Array) -> None:
    """Fill ``frames`` (n+1, 3, 4): pose of every joint (turned by q) and of the tool in the base frame."""
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


@compiled
def jacobian(frames: Array, jac: Array) -> None:
    """Fill ``jac`` (6, n): tool twist in its own axes by joint velocity, as pinocchio's LOCAL frame Jacobian."""
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


@compiled
def pose_gap(pose: Array, target: Array, weights: Array, gap: Array) -> float:
    """Fill ``gap`` (6,): offset of the target's origin and log3 of its rotation, both seen in the pose. Returns gapᵀ W
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


@compiled
def weighted(weights: Array, error: Array) -> float:
    """errorᵀ W error."""
    total = 0.0
    for i in range(6):
        total += weights[i] * error[i] * error[i]
    return total


@compiled
def pose_error(pose: Array, target: Array, weights: Array, error: Array) -> float:
    """Fill ``error`` (6,) with log6(pose⁻¹ target), the body twist that leads from pose to target in unit time.
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


@compiled
def lengths(twist: Array) -> tuple[float, float]:
    """Of the linear and the angular part."""
    return math.sqrt(np.sum(twist[:3] ** 2)), math.sqrt(np.sum(twist[3:] ** 2))


@compiled
def manipulability(jac: Array) -> float:
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


@compiled
def normal_matrix(jac: Array, weights: Array, damping: float, h: Array) -> None:
    """Fill h = Jᵀ W J + damping I."""
    n = jac.shape[1]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for r in range(6):
                total += weights[r] * jac[r, i] * jac[r, j]
            h[i, j] = h[j, i] = total
        h[i, i] += damping


@compiled
def subtract_curvature(jac: Array, pull: Array, h: Array) -> None:
    """Subtract from ``h`` (n, n) the second derivatives of the tool's position along ``pull`` (3,), in the tool's axes:
    pull·∂²p/∂q_i∂q_j = pull·(ω_i × v_j) for i ≤ j."""
    n = jac.shape[1]
    for i in range(n):
        x = pull[1] * jac[5, i] - pull[2] * jac[4, i]
        y = pull[2] * jac[3, i] - pull[0] * jac[5, i]
        z = pull[0] * jac[4, i] - pull[1] * jac[3, i]
        for j in range(i, n):
            h[j, i] -= x * jac[0, j] + y * jac[1, j] + z * jac[2, j]
            h[i, j] = h[j, i]


@compiled
def to_tool(tool: Array, twist: Array, out: Array) -> None:
    """Fill ``out`` (6,) with ``twist`` (6,), given in base axes, in the axes of the pose ``tool`` (3, 4)."""
    for r in range(3):
        out[r] = tool[0, r] * twist[0] + tool[1, r] * twist[1] + tool[2, r] * twist[2]
        out[r + 3] = tool[0, r] * twist[3] + tool[1, r] * twist[4] + tool[2, r] * twist[5]
