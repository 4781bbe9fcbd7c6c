"""The body polygon of a chassis: discs that fill it, and the signed distance from it to a point."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import inlined
from rackhand.services.planner.geometry.se2 import Pose

SPACING = 0.04  # m between the discs along the outline
RIM = 0.025  # m; their radius
LATTICE = 0.1  # m between the discs inside
Array = NDArray[np.float64]


class Footprint(NamedTuple):
    """A convex polygon about the chassis' origin, in metres. Compiled functions take it as it is.

    ``polygon``: corners (n, 2), counter-clockwise. ``samples``: rows px, py, r of discs that lie inside the polygon and
    together fill it (to 1 cm at the outline). ``edges``: rows nx, ny, offset; the body is where
    nx·x + ny·y <= offset for all. ``inscribed`` and ``circumscribed`` are radii about the origin.
    """

    polygon: Array
    samples: Array
    edges: Array
    inscribed: float
    circumscribed: float

    @staticmethod
    def of(polygon: Array) -> Footprint:
        """Raises ``ValueError`` unless it is a convex polygon of three or more points around the origin."""
        points = np.array(polygon, dtype=np.float64, order="C")  # a writable copy: compiled code exists for these only
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
        inscribed, circumscribed = edges[:, 2].min(), np.hypot(points[:, 0], points[:, 1]).max()
        return Footprint(
            points, np.ascontiguousarray(samples), np.ascontiguousarray(edges), float(inscribed), float(circumscribed)
        )


def expanded(polygon: Array, distance: float) -> Array:
    """A convex polygon (n, 2), counter-clockwise, with each side moved outward by ``distance`` in metres.

    A corner goes to the intersection of the moved sides: p + d·(n1 + n2) / (1 + n1·n2), with their unit normals.
    """
    sides = np.roll(polygon, -1, axis=0) - polygon
    lengths = np.hypot(sides[:, 0], sides[:, 1])
    corners, sides = polygon[lengths > 1e-6], sides[lengths > 1e-6]
    normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / lengths[lengths > 1e-6, None]
    before = np.roll(normals, 1, axis=0)
    bisector = (normals + before) / (1.0 + np.sum(normals * before, axis=1))[:, None]
    moved: Array = corners + distance * bisector
    return moved


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


@inlined
def edge_distance(edges: Array, x: float, y: float) -> float:
    """Signed distance in metres from the polygon to a point of the chassis frame: negative inside.

    The largest distance to a side's line, which is a lower bound of the Euclidean distance beyond a corner.
    """
    largest = -1e9
    for k in range(edges.shape[0]):
        largest = max(largest, edges[k, 0] * x + edges[k, 1] * y - edges[k, 2])
    return largest


@inlined
def distance_to_body(edges: Array, pose: Pose, x: float, y: float) -> float:
    """``edge_distance`` of a point of the map to the body at ``pose`` (map frame)."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = x - pose[0], y - pose[1]
    return edge_distance(edges, c * dx + s * dy, -s * dx + c * dy)
