"""Spheres on the links against each other and against spheres of the workspace, as rows of the QP.

Each row bounds how fast one gap closes: rows·v ≤ bounds. Rows are linear, gaps are not: ``stop_is_clear`` is the guard.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rackhand.runtime.compiled import compiled
from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik.arm import Arm, ArmError
from rackhand.services.controller.ik.kernels import forward

Point = tuple[float, float, float]

# Columns of the table of rows: joint and centre of one sphere, of the other, the distance at contact, keep out or in
# (±1).
JOINT_A, CENTER_A, JOINT_B, CENTER_B, CONTACT, SENSE, COLUMNS = 0, 1, 4, 5, 8, 9, 10
RETREAT = 5.0  # [1/s] how fast a gap smaller than that is opened again
LEVER = 2.0  # [m] more than any sphere is away from any axis
RESERVE = 2e-3  # [m] short of contact at which rows stop a closing gap, so that at rest the guard has nothing to do


@dataclass(frozen=True)
class Zone:
    """A sphere of the workspace in the base frame [m]: the arm stays out of it, or the spheres named in ``links`` stay
    in it."""

    center: tuple[float, float, float]
    radius: float
    keep_in: bool = False
    links: tuple[str, ...] = ()  # names of the arm's spheres; empty: all that move


def build_table(arm: Arm, zones: Sequence[Zone], self_collision: bool, margin: float) -> Array:
    """The table (m, 10) of ``collision_rows``: one row a pair of spheres, gaps counted from ``margin`` [m]."""
    rows = []
    if self_collision:
        for a, b in arm.self_collision:
            one, other = arm.spheres[a], arm.spheres[b]
            contact = one.radius + other.radius + margin
            rows.append([other.joint, *other.center, one.joint, *one.center, contact, 1.0])
    names = {sphere.name for sphere in arm.spheres}
    for zone in zones:
        if not (np.all(np.isfinite(zone.center)) and 0.0 < zone.radius < np.inf):
            raise ArmError(f"{zone}: a finite centre and a positive radius were expected")
        if unknown := set(zone.links) - names:
            raise ArmError(f"{zone}: {arm.name} has no spheres {sorted(unknown)}; expected some of {sorted(names)}")
        for sphere in arm.spheres:
            if sphere.joint < 0 or (zone.links and sphere.name not in zone.links):
                continue
            contact = zone.radius + (-1.0 if zone.keep_in else 1.0) * (sphere.radius + margin)
            sense = -1.0 if zone.keep_in else 1.0
            rows.append([sphere.joint, *sphere.center, -1.0, *zone.center, contact, sense])
    return np.array(rows, float).reshape(-1, COLUMNS)


@compiled
def place(frames: Array, joint: int, center: Array) -> Point:
    """Position in the base frame of a point given in the frame of ``joint`` (-1: the base)."""
    if joint < 0:
        return center[0], center[1], center[2]
    f = frames[joint]
    return (
        f[0, 0] * center[0] + f[0, 1] * center[1] + f[0, 2] * center[2] + f[0, 3],
        f[1, 0] * center[0] + f[1, 1] * center[1] + f[1, 2] * center[2] + f[1, 3],
        f[2, 0] * center[0] + f[2, 1] * center[1] + f[2, 2] * center[2] + f[2, 3],
    )


@compiled
def add_derivative(frames: Array, joint: int, point: Point, x: float, y: float, z: float, row: Array) -> None:
    """Add to ``row`` (n,) the derivative by q of (x, y, z)·(a point fixed to ``joint``, now at ``point`` in the base
    frame)."""
    for k in range(joint + 1):
        f = frames[k]
        rx, ry, rz = point[0] - f[0, 3], point[1] - f[1, 3], point[2] - f[2, 3]
        ax, ay, az = f[0, 2], f[1, 2], f[2, 2]
        row[k] += x * (ay * rz - az * ry) + y * (az * rx - ax * rz) + z * (ax * ry - ay * rx)


@compiled
def gap(pair: Array, frames: Array, row: Array) -> float:
    """The gap [m] of one row of the table, and its derivative by q in ``row`` (n,)."""
    joint_a, joint_b, sense = int(pair[JOINT_A]), int(pair[JOINT_B]), pair[SENSE]
    a = place(frames, joint_a, pair[CENTER_A : CENTER_A + 3])
    b = place(frames, joint_b, pair[CENTER_B : CENTER_B + 3])
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    distance = math.sqrt(x * x + y * y + z * z)
    if distance < 1e-9:
        x, y, z = 0.0, 0.0, 1.0  # one centre in the other: any way out is as good
    else:
        x, y, z = sense * x / distance, sense * y / distance, sense * z / distance
    row[:] = 0.0
    add_derivative(frames, joint_a, a, x, y, z, row)
    add_derivative(frames, joint_b, b, -x, -y, -z, row)
    return float(sense * (distance - pair[CONTACT]))


@compiled
def collision_rows(
    table: Array, acceleration: Array, dt: float, frames: Array, rows: Array, bounds: Array, gaps: Array
) -> None:
    """Fill ``rows`` (m, n) and ``bounds`` (m,) of rows·v ≤ bounds, so that no gap closes faster than can be braked; and
    ``gaps`` (m,) [m].

    The bound is the joints' own (``kernels.position_box``), with a quarter of the deceleration that all joints together
    have along the row: the rest is for rows that bind together and for the curvature of the gap."""
    for r in range(table.shape[0]):
        gaps[r] = gap(table[r], frames, rows[r])
        brake = 0.0
        for i in range(rows.shape[1]):
            rows[r, i] = -rows[r, i]
            brake += 0.25 * abs(rows[r, i]) * acceleration[i]
        if gaps[r] > RESERVE:
            bounds[r] = max(0.0, math.sqrt(2.0 * brake * (gaps[r] - RESERVE)) - 0.5 * brake * dt)
        else:
            bounds[r] = RETREAT * max(gaps[r] - RESERVE, -RESERVE)


@compiled
def stop_is_clear(
    table: Array, gaps: Array, placements: Array, acceleration: Array, dt: float, q: Array, v: Array
) -> bool:
    """Whether the arm, moving with v for one tick and then braking all it can, keeps every gap open.

    A gap that is closed already, in ``gaps`` (m,), may not get smaller. Checks every third tick of the braking and its
    end. Braking from the next tick on follows the rest of the same trajectory, so a clear stop always exists."""
    n = q.shape[0]
    travel = 0.0
    for i in range(n):
        travel += LEVER * abs(v[i]) * (2.0 * dt + 0.5 * abs(v[i]) / acceleration[i])
    if np.min(gaps) > travel:
        return True
    here, speed = q + v * dt, v.copy()
    frames, row = np.empty((n + 1, 3, 4)), np.empty(n)
    tick, moving = 0, True
    while moving:
        moving = False
        for i in range(n):
            slower = max(0.0, abs(speed[i]) - acceleration[i] * dt)
            speed[i] = math.copysign(slower, speed[i])
            here[i] += speed[i] * dt
            moving = moving or slower > 0.0
        if tick % 3 == 0 or not moving:
            forward(placements, here, frames)
            for r in range(table.shape[0]):
                if gap(table[r], frames, row) < min(0.0, gaps[r]) - 1e-6:
                    return False
        tick += 1
    return True
