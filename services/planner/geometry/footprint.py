"""The body polygon, and whether it is free at a pose."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.services.planner.planning.field import Field, sample

SPACING = 0.04  # m between the discs along the outline
RIM = 0.025  # m; their radius
LATTICE = 0.1  # m between the discs inside
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Footprint:
    """A convex polygon about the chassis' origin.

    ``samples``: rows px, py, r of discs that lie inside the polygon and together fill it (to 1 cm at the outline).
    ``edges``: rows nx, ny, offset; the body is where nx·x + ny·y <= offset for all. ``inscribed`` and
    ``circumscribed`` are radii about the origin.
    """

    polygon: Array
    samples: Array
    edges: Array
    inscribed: float
    circumscribed: float

    @staticmethod
    def of(polygon: Array) -> Footprint:
        """Raises ``ValueError`` unless it is a convex polygon of three or more points around the origin."""
        points = np.asarray(polygon, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3 or not np.isfinite(points).all():
            raise ValueError(f"footprint of shape {points.shape}, want three or more finite points (n, 2)")
        following = np.roll(points, -1, axis=0)
        if np.sum(points[:, 0] * following[:, 1] - following[:, 0] * points[:, 1]) < 0:
            points = points[::-1].copy()
            following = np.roll(points, -1, axis=0)
        sides = following - points
        lengths = np.hypot(sides[:, 0], sides[:, 1])
        keep = lengths > 1e-6
        normals = np.column_stack([sides[keep, 1], -sides[keep, 0]]) / lengths[keep, None]
        edges = np.column_stack([normals, np.sum(normals * points[keep], axis=1)])
        if (points @ normals.T > edges[:, 2] + 1e-3).any() or (edges[:, 2] <= 0).any():
            raise ValueError("the footprint is not convex, or does not hold the chassis' origin")
        samples = np.vstack([_interior(edges, points), _outline(points, following)])
        return Footprint(
            points, samples, edges, float(edges[:, 2].min()), float(np.hypot(points[:, 0], points[:, 1]).max())
        )


def _outline(points: Array, following: Array) -> Array:
    """Small discs inside along the sides, and the corners."""
    rows = [(*corner, 0.0) for corner in points]
    for start, end in zip(points, following, strict=True):
        side = end - start
        length = float(np.hypot(side[0], side[1]))
        if length <= 2 * RIM:
            continue
        along, inward = side / length, np.array([-side[1], side[0]]) / length
        n = math.ceil((length - 2 * RIM) / SPACING)
        for k in range(n + 1):
            centre = start + inward * RIM + along * (RIM + (length - 2 * RIM) * k / n)
            rows.append((*centre, RIM))
    return np.array(rows)


def _interior(edges: Array, points: Array) -> Array:
    """Discs of the largest radius that fits, on a lattice, the largest first so that collisions show early."""
    low, high = points.min(axis=0), points.max(axis=0)
    xs = np.arange(low[0] + LATTICE / 2, high[0], LATTICE)
    ys = np.arange(low[1] + LATTICE / 2, high[1], LATTICE)
    lattice = np.array([(0.0, 0.0)] + [(x, y) for x in xs for y in ys])
    radius = (edges[:, 2] - lattice @ edges[:, :2].T).min(axis=1)
    rows: Array = np.column_stack([lattice, radius])[radius > RIM]
    largest_first: Array = rows[np.argsort(-rows[:, 2], kind="stable")]
    return largest_first


@compiled
def clearance(
    distance: Field,
    x0: float,
    y0: float,
    resolution: float,
    samples: Array,
    circumscribed: float,
    x: float,
    y: float,
    yaw: float,
    enough: float,
) -> float:
    """Metres between the body and the nearest blocked cell's edge; negative when they overlap.

    Stops looking when it is surely at least ``enough`` (returns at least that), or below 0 by a whole cell.
    """
    half = 0.5 * resolution
    centre = sample(distance, x0, y0, resolution, x, y) - half
    if centre - circumscribed >= enough:
        return centre - circumscribed
    c, s = math.cos(yaw), math.sin(yaw)
    least = 1e9
    for k in range(samples.shape[0]):
        px, py = samples[k, 0], samples[k, 1]
        free = sample(distance, x0, y0, resolution, x + c * px - s * py, y + s * px + c * py) - half - samples[k, 2]
        if free < least:
            least = free
            if least < -resolution:
                break
    return least


@compiled
def sweep_clearance(
    distance: Field,
    x0: float,
    y0: float,
    resolution: float,
    samples: Array,
    circumscribed: float,
    x: float,
    y: float,
    start: float,
    turn: float,
    enough: float,
) -> float:
    """The least clearance while turning on the spot from heading ``start`` by ``turn`` (signed)."""
    n = math.ceil(abs(turn) / 0.08) + 1
    least = 1e9
    for k in range(n + 1):
        free = clearance(distance, x0, y0, resolution, samples, circumscribed, x, y, start + turn * k / n, enough)
        least = min(least, free)
        if least < enough and least < 0.0:
            break
    return least
