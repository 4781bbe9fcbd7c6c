"""A* over position and heading with the real footprint, for tight places where a path of the inscribed circle is not
enough.

Headings are multiples of 15 degrees, positions continuous in bins of 10 cm. Moves: straight and arc, both forward and
backward, and a turn on the spot. From states near the goal a turn, a straight line and a turn are tried as the rest
(an analytic expansion as in Dolgov et al. 2010).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled, compiled_nogil, inlined
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.planning.distance_grid import DistanceGrid, clearance, turn_clearance
from rackhand.services.planner.planning.field import Field, sample
from rackhand.services.planner.planning.heap import pop, push
from rackhand.services.planner.planning.inflation import Inflation, inflation_cost

Array = NDArray[np.float64]

HEADINGS = 24
TURN = 2.0 * math.pi / HEADINGS
BIN = 0.1  # m
STEP = 0.12  # m of one straight move or arc
BACKWARD = 3.0  # cost of a metre backward, in metres forward
REVERSAL = 1.0  # cost of changing direction: what is driven in the time that it takes
TURN_COST = 1.75  # per radian on the spot, likewise
ARC_COST = 0.01  # of an arc beyond a straight move
FIRST_STEPS = 6  # straight steps with the start's own heading, before turning to one of the lattice
RELAXED_SLOPE = 0.15  # clearance asked for beyond that of start or goal, per metre from there
# The rest is tried from every state nearer to the goal than REST_NEAR, from every REST_EVERY-th nearer than REST_FAR.
REST_NEAR, REST_FAR, REST_EVERY = 0.5, 2.5, 8
BACKWARD_REST = 0.5  # m; the longest rest driven backward

# A goal is sealed when fewer states than POCKET can be reached from it, at all of so many headings.
POCKET, PROBED_HEADINGS = 4_000, 64

FOUND, EXHAUSTED, CUT_SHORT, RUNNING = 0, 1, 2, 3

# Direction of travel, change of heading, length in steps. The long arcs, of 1.4 and 2.8 m radius, lead away from a wall
# beside the chassis: on the shortest, of 0.46 m, its corners swing out by 10 cm.
_MOVES = np.array(
    [(1, 0, 1), (0, 1, 0), (0, -1, 0), (-1, 0, 1)]
    + [(travel, turn, length) for travel in (1, -1) for turn in (1, -1) for length in (1, 3, 6)],
    dtype=np.float64,
)


class Margins(NamedTuple):
    """Clearance of the footprint asked for, in metres: in general, at the start, at the goal."""

    general: float
    start: float
    goal: float


class Ends(NamedTuple):
    """Where a search begins and ends: poses (3,). ``any_yaw``: the heading at the goal does not matter."""

    start: Pose
    goal: Pose
    any_yaw: bool
    margins: Margins


class Problem(NamedTuple):
    """``cost``: cost to go of the inscribed circle, the heuristic. ``heuristic_weight``: its weight; above 1 the search
    is faster and its path up to so many times as costly as the best."""

    grid: DistanceGrid
    cost: Field
    footprint: Footprint
    inflation: Inflation
    ends: Ends
    heuristic_weight: float


class Memory(NamedTuple):
    """What a search remembers of each state (bin and heading), and its heap. ``columns``: bins in a row.

    ``travel``: direction of the move that led there, 1, -1, or 0 for a turn on the spot.
    """

    columns: int
    spent: NDArray[np.float32]
    parent: NDArray[np.int32]
    closed: NDArray[np.bool_]
    position: NDArray[np.float32]
    travel: NDArray[np.int8]
    keys: Array
    items: NDArray[np.int64]

    @staticmethod
    def of(grid: DistanceGrid, max_expansions: int) -> Memory:
        rows, columns = (math.ceil(n * grid.geometry.resolution / BIN) + 1 for n in grid.distance.shape)
        states = rows * columns * HEADINGS
        size = (len(_MOVES) - 1) * min(max_expansions, states) + 64
        return Memory(
            columns=columns,
            spent=np.full(states, np.inf, dtype=np.float32),
            parent=np.full(states, -1, dtype=np.int32),
            closed=np.zeros(states, dtype=np.bool_),
            position=np.empty((states, 2), dtype=np.float32),
            travel=np.zeros(states, dtype=np.int8),
            keys=np.empty(size, dtype=np.float64),
            items=np.empty(size, dtype=np.int64),
        )


class Search:
    """A search that can be carried on in slices."""

    def __init__(self, problem: Problem, max_expansions: int) -> None:
        self._problem = problem
        self._max_expansions = max_expansions
        self._memory = Memory.of(problem.grid, max_expansions)
        self._size = _begin(problem, self._memory)
        self._last, self._direction = -1, 1.0
        self.expanded = 0

    def run(self, expansions: int) -> int:
        """Expand so many more states: RUNNING, FOUND, EXHAUSTED, or CUT_SHORT by ``max_expansions``."""
        until = min(self.expanded + expansions, self._max_expansions)
        outcome, self._size, self.expanded, self._last, self._direction = _expand(
            self._problem, self._memory, self._size, self.expanded, until
        )
        over = outcome == RUNNING and self.expanded >= self._max_expansions
        return CUT_SHORT if over else int(outcome)

    def path(self) -> tuple[Array, float]:
        """What was found: rows x, y, yaw, direction of travel to there (1, -1, 0 for a turn on the spot), and the
        direction of the rest that leads from the last row to the goal.

        The first row is where the straight line from the start, with the start's heading, ends.
        """
        m = self._memory
        return _trace(m.parent, m.position, m.travel, self._last), self._direction


def is_sealed(problem: Problem) -> bool:
    """Whether the footprint cannot get far from the goal, at whichever heading it is there: then there is no path, and
    a search from the start would find that out only when it has been everywhere."""
    ends = problem.ends
    start, general, goal = ends.margins.start, ends.margins.general, ends.margins.goal
    flat = np.where(np.isfinite(problem.cost), 0.0, np.inf).astype(problem.cost.dtype)
    headings = ends.goal[2] + np.arange(PROBED_HEADINGS if ends.any_yaw else 1) * 2.0 * math.pi / PROBED_HEADINGS
    for heading in headings:
        pose = np.array([ends.goal[0], ends.goal[1], wrap(heading)])
        away = Ends(pose, ends.start, True, Margins(general, goal, start))
        need = needed(pose[0], pose[1], away)
        if problem.grid.clearance(problem.footprint, pose, need) < need:
            continue  # nothing begins there, and a search would cost its memory
        if Search(problem._replace(cost=flat, ends=away), POCKET).run(POCKET) != EXHAUSTED:
            return False
    return True


@inlined
def needed(x: float, y: float, ends: Ends) -> float:
    """The clearance asked for at a point: the margin, but near start and goal little more than they have themselves."""
    margins, start, goal = ends.margins, ends.start, ends.goal
    at_start = margins.start + RELAXED_SLOPE * math.hypot(x - start[0], y - start[1])
    at_goal = margins.goal + RELAXED_SLOPE * math.hypot(x - goal[0], y - goal[1])
    return float(min(margins.general, at_start, at_goal))


@compiled
def rest_is_free(grid: DistanceGrid, footprint: Footprint, state: Pose, ends: Ends, direction: float) -> bool:
    """Whether a turn, a straight line (forward or backward) and a turn lead freely from a state to the goal."""
    goal = ends.goal
    dx, dy = goal[0] - state[0], goal[1] - state[1]
    length = math.hypot(dx, dy)
    bearing = math.atan2(dy, dx) if length > 1e-3 else state[2]
    if direction < 0 and length > 1e-3:
        bearing += math.pi
    need = needed(state[0], state[1], ends)
    turn = wrap(bearing - state[2])
    if turn_clearance(grid, footprint, state[0], state[1], state[2], turn, need) < need:
        return False
    n = math.ceil(length / grid.geometry.resolution) + 1
    for k in range(n + 1):
        x, y = state[0] + dx * k / n, state[1] + dy * k / n
        need = needed(x, y, ends)
        if clearance(grid, footprint, x, y, bearing, need) < need:
            return False
    if ends.any_yaw:
        return True
    need = min(ends.margins.general, ends.margins.goal)
    turn = wrap(goal[2] - bearing)
    return bool(turn_clearance(grid, footprint, goal[0], goal[1], bearing, turn, need) >= need)


@compiled
def _begin(problem: Problem, memory: Memory) -> int:
    """Puts the states that are reached straight from the start into the heap; returns its size."""
    grid, footprint, ends, start = problem.grid, problem.footprint, problem.ends, problem.ends.start
    heading = round(start[2] / TURN) % HEADINGS
    turn = wrap(heading * TURN - start[2])
    size = 0
    for direction in (1.0, -1.0):
        for n in range(FIRST_STEPS + 1):
            x = start[0] + direction * n * STEP * math.cos(start[2])
            y = start[1] + direction * n * STEP * math.sin(start[2])
            need = needed(x, y, ends)
            if clearance(grid, footprint, x, y, start[2], need) < need:
                break
            free = turn_clearance(grid, footprint, x, y, start[2], turn, need)
            first = _state(grid, memory.columns, x, y, heading)
            price = n * STEP * (1.0 if direction > 0 else BACKWARD)
            if free < need or price >= memory.spent[first]:
                continue
            memory.spent[first] = price
            memory.position[first, 0], memory.position[first, 1] = x, y
            memory.travel[first] = int(direction) if n > 0 else 0
            size = push(memory.keys, memory.items, size, price, first)
    return size


@compiled_nogil
def _expand(problem: Problem, memory: Memory, size: int, expanded: int, until: int) -> tuple[int, int, int, int, float]:
    """A* from the state of the memory. Returns outcome, heap size, states expanded, the last state, its direction."""
    # Taken out of the tuples once: in a loop that costs reference counts.
    grid, cost, footprint, inflation, ends = problem[:5]
    columns, spent, parent, closed, position, travels, keys, items = memory
    state = np.empty(3)
    while size > 0:
        if expanded >= until:
            return RUNNING, size, expanded, -1, 1.0
        size = pop(keys, items, size)
        index = items[size]
        if closed[index]:
            continue
        closed[index] = True
        expanded += 1
        heading = index % HEADINGS
        state[0], state[1] = position[index, 0], position[index, 1]
        state[2] = wrap(heading * TURN)
        direction = _direction_of_rest(grid, footprint, ends, state, expanded)
        if direction != 0.0:
            return FOUND, size, expanded, index, direction
        for move in range(_MOVES.shape[0]):
            travel, turn, length = _MOVES[move, 0], _MOVES[move, 1], _MOVES[move, 2] * STEP
            middle = state[2] + 0.5 * turn * TURN
            x = state[0] + travel * length * math.cos(middle)
            y = state[1] + travel * length * math.sin(middle)
            to_go = _heuristic(grid, cost, ends, state, x, y)
            if not math.isfinite(to_go):
                continue
            there = _state(grid, columns, x, y, (heading + int(turn)) % HEADINGS)
            if closed[there] or not _is_move_free(grid, footprint, ends, state, travel, turn, length):
                continue
            total = spent[index] + _price(grid, inflation, x, y, travel, turn, length, travels[index])
            if total < spent[there] - 1e-6:
                spent[there] = total
                parent[there] = index
                position[there, 0], position[there, 1] = x, y
                travels[there] = int(travel)
                if size >= keys.size:
                    return CUT_SHORT, size, expanded, -1, 1.0
                size = push(keys, items, size, total + problem.heuristic_weight * to_go, there)
    return EXHAUSTED, size, expanded, -1, 1.0


@inlined
def _direction_of_rest(grid: DistanceGrid, footprint: Footprint, ends: Ends, state: Pose, expanded: int) -> float:
    """The direction (1, -1) in which the rest from here to the goal is free; 0 for none, or if it is not tried."""
    goal = ends.goal
    ahead = math.hypot(goal[0] - state[0], goal[1] - state[1])
    if ahead >= REST_NEAR and (ahead >= REST_FAR or expanded % REST_EVERY != 0):
        return 0.0
    for direction in (1.0, -1.0):
        if direction < 0 and ahead > BACKWARD_REST:
            continue
        if rest_is_free(grid, footprint, state, ends, direction):
            return direction
    return 0.0


@inlined
def _heuristic(grid: DistanceGrid, cost: Field, ends: Ends, state: Pose, x: float, y: float) -> float:
    """Cost to go from a point; infinite outside the grid and where no path of the inscribed circle exists."""
    geometry = grid.geometry
    i = math.floor((y - geometry.y) / geometry.resolution)
    j = math.floor((x - geometry.x) / geometry.resolution)
    if i < 0 or j < 0 or i >= cost.shape[0] or j >= cost.shape[1]:
        return np.inf
    to_go = cost[i, j]
    # The field keeps the general margin; near start and goal the lattice may use less.
    if not math.isfinite(to_go) and needed(x, y, ends) < ends.margins.general:
        return math.hypot(ends.goal[0] - state[0], ends.goal[1] - state[1])
    return float(to_go)


@inlined
def _is_move_free(
    grid: DistanceGrid, footprint: Footprint, ends: Ends, state: Pose, travel: float, turn: float, length: float
) -> bool:
    """Whether the footprint has the clearance asked for along a move, its end first, every half step."""
    n = max(2, round(2.0 * length / STEP))
    for k in range(n, 0, -1):
        share = k / n
        x, y, yaw = along_arc(state, travel * length * share, turn * TURN * share)
        need = needed(x, y, ends)
        if clearance(grid, footprint, x, y, yaw, need) < need:
            return False
    return True


@inlined
def along_arc(state: Pose, length: float, turn: float) -> tuple[float, float, float]:
    """The pose after ``length`` metres (negative backward) on the arc that turns by ``turn``, by its chord."""
    chord = length * (1.0 - turn * turn / 24.0)
    middle = state[2] + 0.5 * turn
    return state[0] + chord * math.cos(middle), state[1] + chord * math.sin(middle), state[2] + turn


@inlined
def _price(
    grid: DistanceGrid,
    inflation: Inflation,
    x: float,
    y: float,
    travel: float,
    turn: float,
    length: float,
    travel_before: int,
) -> float:
    """The cost of a move that ends at x, y."""
    if travel == 0.0:
        return TURN_COST * TURN
    free = sample(grid.distance, grid.geometry, x, y) - 0.5 * grid.geometry.resolution - inflation.inscribed
    price = length * inflation_cost(free, inflation) * (1.0 if travel > 0 else BACKWARD) + ARC_COST * abs(turn)
    return price + (REVERSAL if travel_before * travel < 0 else 0.0)


@inlined
def _state(grid: DistanceGrid, columns: int, x: float, y: float, heading: int) -> int:
    """The index of the state at a point with a heading of the lattice."""
    geometry = grid.geometry
    row, column = math.floor((y - geometry.y) / BIN), math.floor((x - geometry.x) / BIN)
    return (row * columns + column) * HEADINGS + heading


@compiled
def _trace(
    parent: NDArray[np.int32],
    position: NDArray[np.float32],
    travel: NDArray[np.int8],
    last: int,
) -> Array:
    n = 1
    index = last
    while parent[index] >= 0:
        index = parent[index]
        n += 1
    path = np.empty((n, 4), dtype=np.float64)
    index = last
    for k in range(n - 1, -1, -1):
        path[k, 0], path[k, 1] = position[index, 0], position[index, 1]
        path[k, 2] = wrap((index % HEADINGS) * TURN)
        path[k, 3] = travel[index]
        index = parent[index]
    return path
