"""The path from a start to a goal for the real footprint, on the map with the obstacles observed on it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.planning import lattice, shaping, straightening
from rackhand.services.planner.planning.bottleneck import Bottleneck
from rackhand.services.planner.planning.corridor import Corridor
from rackhand.services.planner.planning.cost_to_go import cost_to_go
from rackhand.services.planner.planning.distance_grid import DistanceGrid, clearance, turn_clearance
from rackhand.services.planner.planning.field import Field, Mask
from rackhand.services.planner.planning.inflation import Inflation
from rackhand.services.planner.planning.lattice import Ends, Margins, needed
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]
SPACING = 0.05  # m between the points of a path
SMALL_TURN = 0.1  # rad between two segments that are driven without stopping
DIRECT = 0.6  # m; nearer goals are reached by a turn and a straight line if those are free
SMOOTHING_ROUNDS = 60
LONG_SEARCH = 4  # ticks of a search with the footprint, after which the goal is looked at from the other side
SMOOTHING_CLEARANCE = 0.1  # m beyond the circumscribed radius from which on smoothing need not push away
NEAREST_START = 0.3  # m from the start to look for a cell that has a path
RELAXED_END = 0.005  # m by which less than the clearance at start or goal is asked for there


NOWHERE = Geometry(0.0, 0.0, 1.0, 0, 0)
_LIMIT = "the most that the setting planning.search_limit allows"
SLACK = 6.0  # m of cost beyond that of the start, to which the field is known: for driving, which may leave the path


class NoPathFound(Exception):
    """No path. ``disconnected``: none for the inscribed circle. ``footprint``: one for the circle, none for the
    footprint. ``budget``: none found among ``max_expansions`` places, as many as were ``tried``. ``bottleneck``: where
    the widest way is too narrow, and for which radius, where that was looked for."""

    def __init__(self, kind: Literal["disconnected", "footprint", "budget"], text: str, tried: int = 0) -> None:
        super().__init__(text)
        self.kind = kind
        self.text = text
        self.tried = tried
        self.bottleneck: Bottleneck | None = None
        self.needed = 0.0


@dataclass(frozen=True)
class Target:
    """A goal in metres and radians; ``yaw`` None for any heading. ``rotate_in_place``: straight legs, turns on the spot
    at the corners between them."""

    x: float
    y: float
    yaw: float | None
    rotate_in_place: bool = False

    @property
    def pose(self) -> Pose:
        """(3,) array; the yaw is 0 where any heading will do."""
        return np.array([self.x, self.y, self.yaw or 0.0])


@dataclass(frozen=True)
class Segment:
    """A part of a path driven in one direction: rows x, y, body yaw. Turn on the spot to the first row's yaw, then
    drive."""

    points: Array
    backward: bool = False

    @cached_property
    def length(self) -> float:
        """Metres."""
        return float(np.hypot(*np.diff(self.points[:, :2], axis=0).T).sum())


@dataclass(frozen=True)
class Plan:
    """Segments to the goal, and the cost to go of each cell (metres, weighted by inflation) they came from.

    ``geometry``: of the cells of ``cost``. ``start_cost``: the cost to go at the start. ``tight``: found by the search
    with the footprint, so it is to be followed closely. ``open_from``: number of the segments that are planned; those
    after are a rough guide, to be planned when the chassis comes near.
    """

    segments: tuple[Segment, ...]
    cost: Field
    geometry: Geometry = NOWHERE
    tight: bool = False
    start_cost: float = math.inf
    open_from: int | None = None

    @property
    def length(self) -> float:
        """Metres."""
        return sum(segment.length for segment in self.segments)


Search = Generator[None, None, Plan]


class GlobalPlanner:
    """Plans on one map for one footprint."""

    def __init__(self, geometry: Geometry, footprint: Footprint, settings: NavigationSettings) -> None:
        self._geometry = geometry
        self._footprint = footprint
        self._settings = settings
        self._inflation = Inflation(
            footprint.inscribed, float(settings.inflation_radius), float(settings.clearance_weight)
        )

    def plan(self, start: Pose, target: Target, blocked: Mask, tight: bool = False) -> Plan:
        """A whole search at once; raises ``NoPathFound``."""
        steps = self.search(start, target, blocked, tight)
        while True:
            try:
                next(steps)
            except StopIteration as found:
                return cast(Plan, found.value)

    def search(
        self, start: Pose, target: Target, blocked: Mask, tight: bool = False, corridor: Corridor | None = None
    ) -> Search:
        """Search in slices: yields while it is not done, returns the plan, raises ``NoPathFound``.

        ``blocked``: cells (rows, columns) that no part of the footprint may touch. ``tight``: skip the path of the
        inscribed circle, search with the footprint at once. ``corridor``: what the chassis' origin must not leave.
        """
        grid = DistanceGrid.of(blocked, self._geometry)
        room = grid if corridor is None else corridor.narrowed(grid, self._footprint.inscribed)
        row, column = self._geometry.cell(target.x, target.y)
        if not self._geometry.contains(target.x, target.y):
            raise NoPathFound("disconnected", f"the goal ({target.x:.2f}, {target.y:.2f}) is outside the map")
        budget = self._settings.max_expansions
        here = self._index(start)
        reach = self._nearest_start() / self._geometry.resolution
        cost, toward, expanded = cost_to_go(room, row, column, self._inflation, budget, here, reach, SLACK)
        if expanded >= budget:
            raise NoPathFound("budget", f"search ended after {expanded} cells, {_LIMIT}", expanded)
        yield
        ends = self._ends(grid, start, target)
        direct = self._direct(grid, ends) if corridor is None else None
        if direct is not None:
            return Plan((direct,), cost, self._geometry, start_cost=direct.length)
        first = self._start_cell(cost, start)
        if first < 0:
            raise NoPathFound("disconnected", f"no path for the inscribed radius {self._footprint.inscribed:.2f} m")
        start_cost = float(cost.reshape(-1)[first])
        if not tight:
            segments = self._of_inscribed_circle(room, toward, first, ends, target.rotate_in_place)
            if self._fits(grid, segments, ends):
                return Plan(segments, cost, self._geometry, start_cost=start_cost)
        everywhere = cost_to_go(room, row, column, self._inflation, budget, -1, 0.0, 0.0)[0]
        yield
        plan = yield from self._of_footprint(grid, everywhere, ends)
        plan = replace(plan, geometry=self._geometry, start_cost=start_cost)
        if corridor is None:
            return plan
        return replace(plan, segments=tuple(replace(one, points=corridor.kept(one.points)) for one in plan.segments))

    def _nearest_start(self) -> float:
        return max(NEAREST_START, self._geometry.resolution)

    def _index(self, start: Pose) -> int:
        """The flat index of the cell of the start, or of the nearest one on the map."""
        g = self._geometry
        row, column = g.cell(start[0], start[1])
        return min(max(row, 0), g.rows - 1) * g.columns + min(max(column, 0), g.columns - 1)

    def _ends(self, grid: DistanceGrid, start: Pose, target: Target) -> Ends:
        """With less clearance asked for at start and goal if they have less."""
        general, goal = float(self._settings.plan_margin), target.pose
        at_start = grid.clearance(self._footprint, start) - RELAXED_END
        at_goal = 0.0 if target.yaw is None else grid.clearance(self._footprint, goal) - RELAXED_END
        margins = Margins(general, min(general, at_start), min(general, at_goal))
        return Ends(np.array(start, dtype=np.float64), goal, target.yaw is None, margins)

    def _start_cell(self, cost: Field, start: Pose) -> int:
        """The index of the cell nearest to the start from which a path exists; -1 for none nearby."""
        g = self._geometry
        row, column = g.cell(start[0], start[1])
        reach = math.ceil(self._nearest_start() / g.resolution)
        best, best_distance = -1, self._nearest_start()
        for i in range(max(row - reach, 0), min(row + reach + 1, g.rows)):
            for j in range(max(column - reach, 0), min(column + reach + 1, g.columns)):
                x, y = g.centre(i, j)
                away = math.hypot(x - start[0], y - start[1])
                if np.isfinite(cost[i, j]) and away < best_distance:
                    best, best_distance = i * g.columns + j, away
        return best

    def _direct(self, grid: DistanceGrid, ends: Ends) -> Segment | None:
        """A straight line to a near goal, forward or backward; None where it is far or not free."""
        start, goal = ends.start, ends.goal
        dx, dy = goal[0] - start[0], goal[1] - start[1]
        if math.hypot(dx, dy) > DIRECT:
            return None
        ahead = abs(wrap(math.atan2(dy, dx) - start[2])) <= math.pi / 2
        for backward in (not ahead, ahead):
            if lattice.rest_is_free(grid, self._footprint, start, ends, -1.0 if backward else 1.0):
                return straight(start, goal, backward)
        return None

    def _of_inscribed_circle(
        self, grid: DistanceGrid, toward: NDArray[np.int32], first: int, ends: Ends, straight_legs: bool
    ) -> tuple[Segment, ...]:
        """Steepest descent of the cost to go, pulled tight, and smoothed unless legs are to be straight."""
        points = shaping.chain(toward, first, self._geometry)
        points = np.vstack([ends.start[None, :2], points[1:-1], ends.goal[None, :2]])
        corners = shaping.pull_tight(grid, self._inflation, points)
        if straight_legs:
            legs = [shaping.resample(corners[k : k + 2], SPACING) for k in range(len(corners) - 1)]
        else:
            wanted = self._footprint.circumscribed + SMOOTHING_CLEARANCE + 0.5 * self._geometry.resolution
            dense = shaping.smooth(grid, shaping.resample(corners, SPACING), wanted, SMOOTHING_ROUNDS)
            legs = [shaping.resample(dense, SPACING)]
        return tuple(Segment(shaping.headings(leg)) for leg in legs)

    def _fits(self, grid: DistanceGrid, segments: tuple[Segment, ...], ends: Ends) -> bool:
        """Whether the footprint is free along the segments, in the turns between them, and in the last turn."""
        points = np.vstack([segment.points for segment in segments])
        return bool(path_is_free(grid, self._footprint, points, ends))

    def _of_footprint(self, grid: DistanceGrid, cost: Field, ends: Ends) -> Search:
        s, radius = self._settings, self._footprint.inscribed
        problem = lattice.Problem(grid, cost, self._footprint, self._inflation, ends, float(s.heuristic_weight))
        search = lattice.Search(problem, s.max_expansions)
        while (outcome := search.run(s.expansions_per_tick)) == lattice.RUNNING:
            yield
            if search.expanded == s.expansions_per_tick * LONG_SEARCH and lattice.is_sealed(problem):
                outcome = lattice.EXHAUSTED
                break
        if outcome == lattice.CUT_SHORT:
            text = f"search with the footprint ended after {search.expanded} states without a path, {_LIMIT}"
            raise NoPathFound("budget", text, search.expanded)
        if outcome == lattice.EXHAUSTED:
            text = f"a path exists for the inscribed radius {radius:.2f} m, none for the footprint"
            raise NoPathFound("footprint", text)
        rows, direction = search.path()
        rows = dense(rows)
        start, last = ends.start, rows[-1, :3]
        first = Segment(_line(start[:2], rows[0, :2], start[2]), bool(rows[0, 3] < 0))
        rest = straight(last, ends.goal, direction < 0)
        found = _joined([first, *_segments(rows), rest])
        yield
        return Plan(_straightened(problem, found), cost, tight=True)


@compiled
def path_is_free(grid: DistanceGrid, footprint: Footprint, points: Array, ends: Ends) -> bool:
    """Whether the footprint has the clearance asked for along rows x, y, yaw, with turns on the spot from the start's
    heading to the first row's, between rows, and to the goal's heading."""
    yaw = ends.start[2]
    for k in range(len(points)):
        x, y, heading = points[k]
        if not _turns_freely(grid, footprint, points[k], yaw, needed(x, y, ends)):
            return False
        yaw = heading
    if ends.any_yaw:
        return True
    return _turns_freely(grid, footprint, ends.goal, yaw, min(ends.margins.general, ends.margins.goal))


@compiled
def _turns_freely(grid: DistanceGrid, footprint: Footprint, pose: Pose, before: float, need: float) -> bool:
    """Whether a turn on the spot from the heading ``before`` to that of ``pose`` is free, one way round or the
    other."""
    x, y, yaw = pose
    turn = wrap(yaw - before)
    if abs(turn) < SMALL_TURN:
        return bool(clearance(grid, footprint, x, y, yaw, need) >= need)
    if turn_clearance(grid, footprint, x, y, before, turn, need) >= need:
        return True
    other = turn - math.copysign(2.0 * math.pi, turn)
    return bool(turn_clearance(grid, footprint, x, y, before, other, need) >= need)


def straight(start: Pose, end: Pose, backward: bool) -> Segment:
    """A straight segment between two points; the yaw of ``start`` is kept if it has no length."""
    yaw, dx, dy = float(start[2]), end[0] - start[0], end[1] - start[1]
    if math.hypot(dx, dy) > 1e-3:
        yaw = math.atan2(dy, dx) + (math.pi if backward else 0.0)
    return Segment(_line(start[:2], end[:2], wrap(yaw)), backward)


def _line(start: Array, end: Array, yaw: float) -> Array:
    points = shaping.resample(np.vstack([start, end]), SPACING)
    return np.column_stack([points, np.full(len(points), yaw)])


def _joined(segments: list[Segment]) -> tuple[Segment, ...]:
    """Without those that have no length; those that continue in the same direction with a small turn are one."""
    joined: list[Segment] = []
    for segment in segments[:-1]:
        if segment.length > 0.0:
            _join(joined, segment)
    _join(joined, segments[-1])
    return tuple(joined)


def _join(joined: list[Segment], segment: Segment) -> None:
    last = joined[-1] if joined else None
    if last is not None and last.backward == segment.backward and _continues(last, segment):
        joined[-1] = Segment(np.vstack([last.points, segment.points[1:]]), segment.backward)
    else:
        joined.append(segment)


def _straightened(problem: lattice.Problem, segments: tuple[Segment, ...]) -> tuple[Segment, ...]:
    """The segments with fewer bends, those of one direction in a row together."""
    runs = [list(run) for _, run in itertools.groupby(segments, key=lambda segment: segment.backward)]
    found: list[Segment] = []
    for k, run in enumerate(runs):
        is_last, ends = k == len(runs) - 1, problem.ends
        turn_to = (None if ends.any_yaw else float(ends.goal[2])) if is_last else float(runs[k + 1][0].points[0, 2])
        rows, backward = np.vstack([segment.points for segment in run]), run[0].backward
        parts = straightening.straightened(problem, rows, backward, turn_to, is_last)
        found += [Segment(part, backward) for part in parts] or run
    return tuple(found)


def _continues(last: Segment, following: Segment) -> bool:
    return abs(wrap(following.points[0, 2] - last.points[-1, 2])) <= SMALL_TURN


def dense(rows: Array) -> Array:
    """Lattice rows x, y, yaw, direction with points at most ``SPACING`` apart along each arc."""
    parts = [rows[:1]]
    for before, row in itertools.pairwise(rows):
        length, turn = math.hypot(*(row[:2] - before[:2])), wrap(row[2] - before[2])
        n = 1 if row[3] == 0.0 else max(1, math.ceil(length / SPACING))
        share = np.arange(1, n + 1) / n
        arc = np.array([lattice.along_arc(before[:3], row[3] * length * part, turn * part) for part in share])
        arc[:, :2] += share[:, None] * (row[:2] - arc[-1, :2])
        arc[-1] = row[:3]
        parts.append(np.column_stack([arc, np.full(n, row[3])]))
    return np.vstack(parts)


def _segments(rows: Array) -> list[Segment]:
    """Lattice rows x, y, yaw, direction as segments of one direction each; turns on the spot fall between them."""
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
