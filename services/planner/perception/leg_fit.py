"""The pose of a rack from its legs in one scan, by least squares.

Each leg gives two measurements about the lidar: the mean range of its hits, and the bearing midway between its
outermost hits. They are compared with the mean range and the middle of the bearings of the faces that are visible.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.perception.clusters import Clusters

Array = NDArray[np.float64]

RANGE_NOISE = 0.01  # m, 1σ of one hit
LEAST_STEP = math.radians(0.25)  # between beams, for a leg with a single hit
RAYS = 8  # over the visible width of a leg
ITERATIONS = 6
SETTLED = 1e-4  # m and rad of the last step
DELTA = 1e-5  # m and rad, for derivatives
OUTLIER = 2.0  # standard deviations from which on a measurement counts less (Huber)
ROUND_FACE = math.pi / 4  # mean height of a half circle, in radii


class LegFit(NamedTuple):
    """``pose`` of the rack; ``legs``: middles of the legs as measured, (n, 2); ``rms`` of the residuals in metres."""

    pose: Pose
    legs: Array
    rms: float


def fit_legs(legs: Clusters, sensor: Array, middles: Array, spec: RackSpec, start: Pose) -> LegFit:
    """Gauss–Newton from ``start``. ``middles``: of the legs in the rack's frame, (n, 2), a row for each cluster;
    ``sensor``: the lidar's position (x, y first), in the frame of the result."""
    steps = np.maximum(legs.steps, LEAST_STEP)
    # The true edge is up to one beam beyond the outermost hit, on each side: the middle is off by step/√6·½ at 1σ.
    sigma = np.concatenate([RANGE_NOISE / np.sqrt(legs.counts), legs.ranges * steps / math.sqrt(24.0) + 1e-3])

    is_round, half = spec.leg_shape == "round", 0.5 * spec.leg_size
    at = np.array(sensor[:2], dtype=np.float64)

    def residuals(pose: Pose) -> Array:
        return _residuals(pose, middles, legs.ranges, legs.bearings, at, half, is_round)

    pose = np.array(start, dtype=np.float64)
    for _ in range(ITERATIONS):
        error = residuals(pose)
        jacobian = np.column_stack([(residuals(pose + DELTA * unit) - error) / DELTA for unit in np.eye(3)])
        scaled = np.abs(error) / sigma
        weights = np.where(scaled > OUTLIER, OUTLIER / np.maximum(scaled, OUTLIER), 1.0) / sigma**2
        step = np.linalg.solve(jacobian.T @ (weights[:, None] * jacobian), -jacobian.T @ (weights * error))
        pose = pose + step
        if np.abs(step).max() < SETTLED:
            break
    pose[2] = wrap(pose[2])
    error = residuals(pose)
    return LegFit(pose, _measured(sensor, se2.transformed(pose, middles), error), float(np.sqrt(np.mean(error**2))))


@compiled
def _residuals(
    pose: Pose, middles: Array, ranges: Array, bearings: Array, sensor: Array, half: float, is_round: bool
) -> Array:
    """Metres by which each leg is farther than expected, (n,), and then by which it is to the left, (n,)."""
    n = len(middles)
    error = np.empty(2 * n)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(n):
        dx = pose[0] + c * middles[k, 0] - s * middles[k, 1] - sensor[0]
        dy = pose[1] + s * middles[k, 0] + c * middles[k, 1] - sensor[1]
        bearing = math.atan2(dy, dx)
        if is_round:
            distance, aside = math.hypot(dx, dy) - ROUND_FACE * half, 0.0
        else:
            distance, aside = _faces(c * dx + s * dy, -s * dx + c * dy, half)
        error[k] = ranges[k] - distance
        error[n + k] = ranges[k] * wrap(bearings[k] - bearing - aside)
    return error


@compiled
def _faces(x: float, y: float, half: float) -> tuple[float, float]:
    """Mean range of the visible faces of a square leg whose middle is at x, y from the lidar, along the leg's sides;
    and by how much the middle of their bearings is off that of the leg's middle."""
    zero = math.atan2(y, x)
    low = high = 0.0
    for i in (-half, half):
        for j in (-half, half):
            aside = wrap(math.atan2(y + j, x + i) - zero)
            low, high = min(low, aside), max(high, aside)
    total = 0.0
    for k in range(RAYS):
        ray = zero + low + (high - low) * (k + 0.5) / RAYS
        # The slab method: a ray is inside the leg when it is inside both slabs, so it enters at the later entry.
        along, across = math.cos(ray), math.sin(ray)
        enter = -math.inf
        if abs(along) > 1e-12:
            enter = (x - math.copysign(half, along)) / along
        if abs(across) > 1e-12:
            enter = max(enter, (y - math.copysign(half, across)) / across)
        total += enter
    return total / RAYS, 0.5 * (low + high)


def _measured(sensor: Array, middles: Array, error: Array) -> Array:
    """Middles of the legs moved by what was measured beyond what was expected, (n, 2)."""
    n = len(middles)
    away = middles - sensor[:2]
    away = away / np.hypot(away[:, 0], away[:, 1])[:, None]
    aside = np.column_stack([-away[:, 1], away[:, 0]])
    moved: Array = middles + error[:n, None] * away + error[n:, None] * aside
    return moved
