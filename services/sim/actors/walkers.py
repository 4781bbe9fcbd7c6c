"""People on scripts: where one who walks in a loop is, as a function of time and of who stands in the way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from rackhand.schemas.planar import wrap
from rackhand.worlds.data import Point, PoseTuple

# A walker stands still while a robot's body is nearer than this in front of it, as people do. It looks ahead, not
# behind: a robot that drives into someone's back still hits them.
KEEP_CLEAR = 0.5
SHORTEST_LEG = 0.01
FASTEST = 10.0
IN_FRONT = math.radians(75)


@dataclass(frozen=True)
class Route:
    """A closed way through ``points`` (no two neighbours the same) at ``speed``, with ``wait`` seconds at each."""

    points: tuple[Point, ...]
    speed: float
    wait: float = 0.0


@dataclass(frozen=True)
class Walker:
    """Somebody on a route: ``leg`` leads from ``points[leg]`` to the next, ``way`` metres of it are walked."""

    route: Route
    leg: int = 0
    way: float = 0.0
    resting: float = 0.0

    @property
    def pose(self) -> PoseTuple:
        (x0, y0), (x1, y1) = self._ends()
        length = math.hypot(x1 - x0, y1 - y0)
        part = self.way / length
        return x0 + part * (x1 - x0), y0 + part * (y1 - y0), math.atan2(y1 - y0, x1 - x0)

    def after(self, dt: float) -> Walker:
        """The same walker ``dt`` seconds of undisturbed walking later."""
        walker, left = self, dt
        while left > 0:
            if walker.resting > 0:
                rest = min(left, walker.resting)
                walker, left = replace(walker, resting=walker.resting - rest), left - rest
                continue
            (x0, y0), (x1, y1) = walker._ends()
            length = math.hypot(x1 - x0, y1 - y0)
            if walker.way + left * self.route.speed < length:
                return replace(walker, way=walker.way + left * self.route.speed)
            left -= (length - walker.way) / self.route.speed
            walker = Walker(self.route, (walker.leg + 1) % len(self.route.points), 0.0, self.route.wait)
        return walker

    def _ends(self) -> tuple[Point, Point]:
        points = self.route.points
        return points[self.leg], points[(self.leg + 1) % len(points)]


def make_route(points: Sequence[Point], speed: float, wait: float = 0.0) -> Route:
    """A loop through the points; a point that repeats the one before it is left out. Raises ``ValueError``."""
    distinct = [p for i, p in enumerate(points) if math.dist(p, points[i - 1]) > SHORTEST_LEG]
    if len(distinct) < 2:
        raise ValueError(f"a walk needs two points that are more than {SHORTEST_LEG} m apart, got {list(points)}")
    if not 0 < speed <= FASTEST:
        raise ValueError(f"a walk needs a speed above 0 and up to {FASTEST} m/s, got {speed}")
    return Route(tuple(distinct), speed, wait)


def is_in_way(walker: PoseTuple, radius: float, robot: PoseTuple, half_length: float, half_width: float) -> bool:
    """Whether a robot's body (a rectangle about its pose) is within ``KEEP_CLEAR`` in front of a walker."""
    dx, dy = walker[0] - robot[0], walker[1] - robot[1]
    c, s = math.cos(robot[2]), math.sin(robot[2])
    ahead, aside = c * dx + s * dy, c * dy - s * dx
    nearest = (max(-half_length, min(half_length, ahead)), max(-half_width, min(half_width, aside)))
    gap_x, gap_y = nearest[0] - ahead, nearest[1] - aside
    distance = math.hypot(gap_x, gap_y)
    if distance > radius + KEEP_CLEAR:
        return False
    bearing = math.atan2(s * gap_x + c * gap_y, c * gap_x - s * gap_y)
    return distance == 0 or abs(wrap(bearing - walker[2])) < IN_FRONT
