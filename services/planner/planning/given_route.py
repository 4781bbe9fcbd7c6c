"""A route that a client gives: its points as text, and the legs that are driven along them.

A leg is driven without stopping. Small bends between its points are rounded by arcs that stay within ``ROUNDING`` of
the given line; at every larger one a leg ends, and the chassis turns on the spot.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import wrap
from rackhand.services.planner.planning.plan import SPACING

Array = NDArray[np.float64]
ROUNDING = 0.02  # m between a bend and the arc that rounds it
SHARPEST_ROUNDED = 0.35  # rad; a larger bend ends the leg
STRAIGHT = 1e-3  # rad; a smaller bend needs no arc
LEAST_SIDE = 0.01  # m; nearer points count as one
LONGEST = 5000.0  # m


@dataclass(frozen=True)
class Leg:
    """``rows``: x, y, yaw, at most ``SPACING`` apart. ``curvature``: 1/m at each row, positive to the left.
    ``passed``: how many of the given points are behind or at each row."""

    rows: Array
    curvature: Array
    passed: NDArray[np.int64]


@dataclass(frozen=True)
class GivenRoute:
    """``points``: as given, (n, 2) in metres, map frame. ``corners``: those that are left of them without repetition,
    (m, 2), and ``passed`` how many given points each of them stands for, together with all before it."""

    points: Array
    corners: Array
    passed: NDArray[np.int64]

    @property
    def length(self) -> float:
        """Metres."""
        return float(np.hypot(*np.diff(self.corners, axis=0).T).sum())


def parse_route(text: str | None) -> GivenRoute:
    """From ``"x1, y1, x2, y2, …"``. Raises ``MoveFailed(INVALID_TRACK_POINTS)`` naming what is wrong with it."""
    numbers = [] if text is None or not text.strip() else [_number(part, k) for k, part in enumerate(text.split(","))]
    if len(numbers) % 2:
        raise _invalid(f"{len(numbers)} numbers, expected an even count: x1, y1, x2, y2, …")
    points = np.array(numbers, dtype=np.float64).reshape(-1, 2)
    if len(points) < 2:
        raise _invalid(f"{len(points)} point(s), expected at least 2")
    kept = [0]
    for k in range(1, len(points)):
        if math.dist(points[k], points[kept[-1]]) >= LEAST_SIDE:
            kept.append(k)
    if len(kept) < 2:
        raise _invalid(f"{len(points)} points within {LEAST_SIDE} m of each other, expected at least 2 different ones")
    route = GivenRoute(points, points[kept], np.array([*kept[1:], len(points)]))
    if not route.length <= LONGEST:
        raise _invalid(f"a route of {route.length:.0f} m, expected at most {LONGEST:.0f} m")
    return route


def _number(part: str, index: int) -> float:
    try:
        value = float(part)
    except ValueError:
        raise _invalid(f"number {index + 1} is {part.strip()[:40]!r}, expected a decimal number") from None
    if not math.isfinite(value):
        raise _invalid(f"number {index + 1} is {part.strip()[:40]!r}, expected a finite one")
    return value


def _invalid(what: str) -> MoveFailed:
    return MoveFailed(MoveFailReason.INVALID_TRACK_POINTS, f"route_coordinates: {what}")


def legs_of(route: GivenRoute) -> tuple[Leg, ...]:
    """The legs in order; each begins where the one before ends."""
    corners = route.corners
    sides = np.diff(corners, axis=0)
    yaws = np.arctan2(sides[:, 1], sides[:, 0])
    turns = [wrap(float(yaws[k] - yaws[k - 1])) for k in range(1, len(yaws))]  # at corner k + 1
    ends = [k + 1 for k, turn in enumerate(turns) if abs(turn) > SHARPEST_ROUNDED]
    bounds = [0, *ends, len(corners) - 1]
    return tuple(_leg(route, first, last) for first, last in itertools.pairwise(bounds))


def _leg(route: GivenRoute, first: int, last: int) -> Leg:
    """Between the corners ``first`` and ``last``: straight pieces, and an arc at each bend between them."""
    parts: list[tuple[Array, Array, NDArray[np.int64]]] = []
    start = route.corners[first]
    for k in range(first + 1, last):
        arc = _arc(route.corners[k - 1], route.corners[k], route.corners[k + 1])
        _add_line(parts, start, arc[0, :2], int(route.passed[k - 1]))
        if len(arc) > 1:
            passed = np.where(np.arange(len(arc)) < len(arc) // 2, route.passed[k - 1], route.passed[k])
            parts.append((arc[:, :3], arc[:, 3], passed))
        start = arc[-1, :2]
    _add_line(parts, start, route.corners[last], int(route.passed[last - 1]))
    rows, curvature, passed = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    distinct = np.append(True, np.hypot(*np.diff(rows[:, :2], axis=0).T) > 1e-9)
    passed[-1] = route.passed[last]
    return Leg(rows[distinct], curvature[distinct], passed[distinct])


def _add_line(parts: list[tuple[Array, Array, NDArray[np.int64]]], start: Array, end: Array, passed: int) -> None:
    length = math.dist(start, end)
    if length < 1e-9:
        return
    n = math.ceil(length / SPACING)
    rows = np.empty((n + 1, 3))
    rows[:, :2] = start + np.linspace(0.0, 1.0, n + 1)[:, None] * (end - start)
    rows[:, 2] = math.atan2(end[1] - start[1], end[0] - start[0])
    parts.append((rows, np.zeros(n + 1), np.full(n + 1, passed)))


def _arc(before: Array, corner: Array, after: Array) -> Array:
    """Rows x, y, yaw, curvature of the arc that rounds a bend; the corner alone where it is as good as straight.

    An arc of radius R that is tangent to both sides of a bend of the angle t begins R·tan(t/2) before it, and its
    middle is R·(1 - cos(t/2)) from the nearer side.
    """
    u, v = corner - before, after - corner
    yaw = math.atan2(u[1], u[0])
    turn = wrap(math.atan2(v[1], v[0]) - yaw)
    half = abs(turn) / 2.0
    if abs(turn) < STRAIGHT:
        return np.array([(*corner, yaw, 0.0)])
    reach = min(ROUNDING / (1.0 - math.cos(half)) * math.tan(half), 0.5 * math.hypot(*u), 0.5 * math.hypot(*v))
    radius = math.copysign(reach / math.tan(half), turn)
    begin = corner - reach * u / math.hypot(*u)
    n = max(2, math.ceil(abs(radius * turn) / SPACING))
    angles = yaw + np.linspace(0.0, turn, n + 1)
    x = begin[0] + radius * (np.sin(angles) - math.sin(yaw))
    y = begin[1] - radius * (np.cos(angles) - math.cos(yaw))
    return np.column_stack([x, y, angles, np.full(n + 1, 1.0 / radius)])
