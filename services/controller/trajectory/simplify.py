"""Fewer waypoints for the same path: those that a straight leg between others passes closely enough.

People send one point twice, recordings with noise, circles of a thousand points. Each waypoint is a corner, and a
corner's blend is at most half a leg: points that are near each other would slow the arm down for nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.model import Placement


@dataclass(frozen=True)
class Resolution:
    """How far a waypoint that is left out may be from the leg that passes it: rad in the joints (as a vector), m and
    rad at the TCP. The first and the last waypoint are always kept."""

    joint: float = 1e-3
    position: float = 3e-4
    angle: float = 2e-3


def kept_joints(points: Array, resolution: Resolution) -> list[int]:
    """Which of the waypoints (k, n) [rad] are needed."""
    return kept(points / resolution.joint)


def kept_poses(points: Sequence[Placement], resolution: Resolution) -> list[int]:
    """Which of the poses are needed. Rotations are compared as matrices: ‖R₁ − R₂‖ = 2√2 sin(θ/2), and a chord between
    two matrices is off the turn between them by θ²/8, so that points of large turns are rather kept."""
    rows = [
        np.concatenate([p.translation / resolution.position, p.rotation.ravel() / (np.sqrt(2.0) * resolution.angle)])
        for p in points
    ]
    return kept(np.array(rows))


def kept(points: Array) -> list[int]:
    """Rows of ``points`` (k, d) such that every other one is within 1 of the segment between the kept ones about it
    (Ramer 1972; Douglas and Peucker 1973), and lies on it in their order: a path that goes back and forth on one line
    keeps its turning points."""
    needed = {0, len(points) - 1}
    open_ends = [(0, len(points) - 1)]
    while open_ends:
        first, last = open_ends.pop()
        if last - first < 2:
            continue
        off = _off_segment(points[first + 1 : last], points[first], points[last])
        worst = int(np.argmax(off))
        if off[worst] > 1.0:
            middle = first + 1 + worst
            needed.add(middle)
            open_ends += [(first, middle), (middle, last)]
    return sorted(needed)


def _off_segment(points: Array, a: Array, b: Array) -> Array:
    """Distance (m,) of ``points`` (m, d) to the segment from ``a`` to ``b``, or how far one lies on it before a point
    that comes earlier, whichever is more."""
    along = b - a
    length = float(along @ along)
    share = np.clip((points - a) @ along / length, 0.0, 1.0) if length > 0 else np.zeros(len(points))
    aside = np.linalg.norm(points - a - share[:, None] * along, axis=1)
    back = (np.maximum.accumulate(share) - share) * np.sqrt(length)
    return np.asarray(np.maximum(aside, back))
