"""The way from here to the goal for the real footprint on the map with what is observed on it."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.map.grid import Geometry, Mask
from rackhand.services.planner.planning import lattice, shaping
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.field import Field, cost_to_go
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]
SPACING = 0.05
HARDLY_A_TURN = 0.1  # rad that a body on the way need not stop for
DIRECT = 0.6  # m; nearer goals are reached by a turn and a straight line if those are free
SMOOTHING_ROUNDS = 60
NEAREST_START = 0.3  # m from the start to look for a cell that has a way


class NoPathFound(Exception):
    """There is no way: the circle that fits into the body has none, the body itself has none, or none was found within
    the budget of the search."""

    def __init__(self, kind: Literal["disconnected", "footprint", "budget"], text: str) -> None:
        super().__init__(text)
        self.kind = kind
        self.text = text


@dataclass(frozen=True)
class Target:
    """A goal point; ``yaw`` None for any heading. ``rotate_in_place``: straight legs, headings changed at corners."""

    x: float
    y: float
    yaw: float | None
    rotate_in_place: bool = False


@dataclass(frozen=True)
class Segment:
    """A stretch driven in one direction: rows x, y, body yaw. Turn on the spot to the first row's yaw, then go."""

    points: Array
    backward: bool = False

    @property
    def length(self) -> float:
        return float(np.hypot(*np.diff(self.points[:, :2], axis=0).T).sum())


@dataclass(frozen=True)
class Plan:
    """Segments to the goal, and the cost to go of each cell (metres, weighted by crowding) they came from."""

    segments: tuple[Segment, ...]
    cost: Field
    tight: bool = False

    @property
    def length(self) -> float:
        return sum(segment.length for segment in self.segments)


Search = Generator[None, None, Plan]


class GlobalPlanner:
    """Plans on one map for one footprint."""

    def __init__(self, geometry: Geometry, footprint: Footprint, settings: NavigationSettings) -> None:
        self._g = geometry
        self._footprint = footprint
        self._settings = settings

    def plan(self, start: Pose, target: Target, blocked: Mask, tight: bool = False) -> Plan:
        """A whole search at once; raises ``NoPathFound``."""
        steps = self.search(start, target, blocked, tight)
        while True:
            try:
                next(steps)
            except StopIteration as found:
                return cast(Plan, found.value)

    def search(self, start: Pose, target: Target, blocked: Mask, tight: bool = False) -> Search:
        """Look for a way in slices: yields while it is not done, returns the plan, raises ``NoPathFound``.

        ``tight``: do not trust the point-like plan, search with the footprint at once.
        """
        room = DistanceGrid.of(blocked, self._g)
        row, column = self._g.cell(target.x, target.y)
        s = self._settings
        cost, toward, expanded = cost_to_go(
            room.distance, self._g.resolution, row, column, self._footprint.inscribed, s.inflation_radius,
            s.clearance_weight, s.max_expansions,
        )  # fmt: skip
        if expanded >= s.max_expansions:
            raise NoPathFound("budget", f"{expanded} cells expanded without reaching all")
        direct = self._direct(room, cost, start, target)
        if direct is not None:
            return direct
        first = self._start_cell(cost, start)
        if first < 0:
            raise NoPathFound("disconnected", f"no path for the inscribed radius {self._footprint.inscribed:.2f} m")
        if not tight:
            plan = self._point_like(room, cost, toward, first, start, target)
            if plan is not None:
                return plan
        return (yield from self._with_footprint(room, cost, start, target))

    def _margins(self, room: DistanceGrid, start: Pose, target: Target) -> Array:
        """Clearance asked for in general, at the start, at the goal: less at the ends if they have less."""
        general = self._settings.plan_margin
        at_start = room.clearance(self._footprint, start) - 0.005
        at_goal = 0.0
        if target.yaw is not None:
            at_goal = room.clearance(self._footprint, np.array([target.x, target.y, target.yaw])) - 0.005
        return np.array([general, min(general, at_start), min(general, at_goal)])

    def _start_cell(self, cost: Field, start: Pose) -> int:
        """The index of the cell nearest to the start that has a way; -1 for none nearby."""
        row, column = self._g.cell(start[0], start[1])
        reach = math.ceil(NEAREST_START / self._g.resolution)
        best, best_distance = -1, NEAREST_START
        for i in range(max(row - reach, 0), min(row + reach + 1, self._g.rows)):
            for j in range(max(column - reach, 0), min(column + reach + 1, self._g.columns)):
                x, y = self._g.centre(i, j)
                away = math.hypot(x - start[0], y - start[1])
                if np.isfinite(cost[i, j]) and away < best_distance:
                    best, best_distance = i * self._g.columns + j, away
        return best

    def _direct(self, room: DistanceGrid, cost: Field, start: Pose, target: Target) -> Plan | None:
        away = math.hypot(target.x - start[0], target.y - start[1])
        if away > DIRECT:
            return None
        bearing = math.atan2(target.y - start[1], target.x - start[0])
        margins = self._margins(room, start, target)
        ahead = abs(wrap(bearing - start[2])) <= math.pi / 2
        for backward in (not ahead, ahead):
            if self._rest_is_free(room, start, start, target, margins, backward):
                segment = straight(start[0], start[1], target.x, target.y, start[2], backward)
                return Plan((segment,), cost)
        return None

    def _rest_is_free(
        self, room: DistanceGrid, state: Pose, start: Pose, target: Target, margins: Array, backward: bool
    ) -> bool:
        g, f = self._g, self._footprint
        goal = np.array([target.x, target.y, target.yaw or 0.0])
        return bool(
            lattice.rest_is_free(
                room.distance, g.x, g.y, g.resolution, f.samples, f.circumscribed, state, start, goal,
                target.yaw is None, margins, -1.0 if backward else 1.0,
            )
        )  # fmt: skip

    def _point_like(
        self, room: DistanceGrid, cost: Field, toward: NDArray[np.int32], first: int, start: Pose, target: Target
    ) -> Plan | None:
        """Steepest descent of the cost to go, pulled tight and smoothed; None where the body does not fit along it."""
        g, s, radius = self._g, self._settings, self._footprint.inscribed
        points = shaping.chain(toward, g.columns, first, g.x, g.y, g.resolution)
        points = np.vstack([start[None, :2], points[1:-1], [(target.x, target.y)]])
        corners = shaping.pull_tight(
            room.distance, g.x, g.y, g.resolution, points, radius, s.inflation_radius, s.clearance_weight
        )
        if target.rotate_in_place:
            legs = [shaping.resample(corners[k : k + 2], SPACING) for k in range(len(corners) - 1)]
        else:
            dense = shaping.resample(corners, SPACING)
            wanted = self._footprint.circumscribed + 0.1 + 0.5 * g.resolution
            dense = shaping.smooth(room.distance, g.x, g.y, g.resolution, dense, wanted, SMOOTHING_ROUNDS)
            legs = [shaping.resample(dense, SPACING)]
        segments = tuple(Segment(shaping.headings(leg)) for leg in legs)
        fits = self._fits(room, segments, start, target)
        return Plan(segments, cost) if fits else None

    def _fits(self, room: DistanceGrid, segments: tuple[Segment, ...], start: Pose, target: Target) -> bool:
        """Whether the body is free along the segments, the turns between them, and the last turn."""
        margins = self._margins(room, start, target)
        goal = np.array([target.x, target.y, target.yaw or 0.0])
        yaw = float(start[2])
        for segment in segments:
            for x, y, heading in segment.points:
                need = lattice.needed(x, y, start, goal, margins)
                if not self._turns_freely(room, x, y, yaw, heading, need):
                    return False
                yaw = heading
        if target.yaw is None:
            return True
        return self._turns_freely(room, target.x, target.y, yaw, target.yaw, min(margins[0], margins[2]))

    def _turns_freely(self, room: DistanceGrid, x: float, y: float, start: float, end: float, need: float) -> bool:
        turn = wrap(end - start)
        if abs(turn) < 0.1:
            return room.clearance(self._footprint, np.array([x, y, end]), need) >= need
        turns = (turn, turn - math.copysign(2 * math.pi, turn))
        here = np.array([x, y, start])
        return any(room.turn_clearance(self._footprint, here, t, need) >= need for t in turns)

    def _with_footprint(self, room: DistanceGrid, cost: Field, start: Pose, target: Target) -> Search:
        g, f, s = self._g, self._footprint, self._settings
        goal = np.array([target.x, target.y, target.yaw or 0.0])
        search = lattice.Search(
            room.distance, cost, (g.x, g.y), g.resolution, f.samples, (f.inscribed, f.circumscribed), start, goal,
            target.yaw is None, self._margins(room, start, target), s.inflation_radius, s.clearance_weight,
            s.heuristic_weight, s.max_expansions,
        )  # fmt: skip
        while (outcome := search.run(s.expansions_per_tick)) == lattice.RUNNING:
            yield
        if outcome == lattice.CUT_SHORT:
            raise NoPathFound("budget", f"{search.expanded} states expanded without a path")
        if outcome == lattice.EXHAUSTED:
            raise NoPathFound("footprint", f"the inscribed radius {f.inscribed:.2f} m has a path, the footprint none")
        rows, direction = search.way()
        last = rows[-1]
        first = Segment(_line(start[:2], rows[0, :2], start[2]), bool(rows[0, 3] < 0))
        rest = straight(last[0], last[1], target.x, target.y, last[2], direction < 0)
        return Plan(_joined([first, *_segments(rows), rest]), cost, tight=True)


def straight(x0: float, y0: float, x1: float, y1: float, yaw: float, backward: bool) -> Segment:
    """A straight stretch; ``yaw`` is kept if it has no length."""
    if math.hypot(x1 - x0, y1 - y0) > 1e-3:
        yaw = math.atan2(y1 - y0, x1 - x0) + (math.pi if backward else 0.0)
    return Segment(_line(np.array([x0, y0]), np.array([x1, y1]), wrap(yaw)), backward)


def _line(start: Array, end: Array, yaw: float) -> Array:
    points = shaping.resample(np.vstack([start, end]), SPACING)
    return np.column_stack([points, np.full(len(points), yaw)])


def _joined(segments: list[Segment]) -> tuple[Segment, ...]:
    """Without those that have no length, and with those in one that go on in the same direction with hardly a turn."""
    joined: list[Segment] = []
    for segment in segments[:-1]:
        if segment.length > 0.0:
            _join(joined, segment)
    _join(joined, segments[-1])
    return tuple(joined)


def _join(joined: list[Segment], segment: Segment) -> None:
    last = joined[-1] if joined else None
    if last is not None and last.backward == segment.backward and _hardly_turns(last, segment):
        joined[-1] = Segment(np.vstack([last.points, segment.points[1:]]), segment.backward)
    else:
        joined.append(segment)


def _hardly_turns(last: Segment, following: Segment) -> bool:
    return abs(wrap(following.points[0, 2] - last.points[-1, 2])) <= HARDLY_A_TURN


def _segments(rows: Array) -> list[Segment]:
    """Lattice rows x, y, yaw, direction as stretches driven in one direction; turns on the spot fall between them."""
    found: list[Segment] = []
    k = 1
    while k < len(rows):
        direction = rows[k, 3]
        end = k
        while end + 1 < len(rows) and rows[end + 1, 3] == direction:
            end += 1
        if direction != 0.0:
            found.append(Segment(rows[k - 1 : end + 1, :3].copy(), bool(direction < 0)))
        k = end + 1
    return found
