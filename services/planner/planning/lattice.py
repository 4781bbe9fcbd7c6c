"""A* over position and heading with the real footprint, for where a point-like plan does not fit.

Headings are multiples of 15 degrees, positions continuous in bins of 10 cm. Moves: straight, arc, both also
backwards, and a turn on the spot. From states near the goal a turn, a straight line and a turn are tried as the rest.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.services.planner.geometry.footprint import clearance, sweep_clearance
from rackhand.services.planner.planning.field import Field, crowding, sample
from rackhand.services.planner.planning.heap import pop, push

Array = NDArray[np.float64]

HEADINGS = 24
TURN = 2.0 * math.pi / HEADINGS
BIN = 0.1
STEP = 0.12  # m of one straight move or arc
BACKWARD = 3.0  # times as dear as forward
REVERSAL = 0.3  # cost of changing direction
TURN_COST = 0.35  # per radian on the spot
FIRST_STEPS = 6  # straight steps with the start's own heading, before turning to one of the lattice
RELAXED_SLOPE = 0.15  # clearance asked for beyond that of start or goal, per metre from there

FOUND, EXHAUSTED, CUT_SHORT, RUNNING = 0, 1, 2, 3


@compiled
def needed(x: float, y: float, start: Array, goal: Array, margins: Array) -> float:
    """The clearance asked for at a point: the margin, but near start and goal little more than they have themselves."""
    at_start = margins[1] + RELAXED_SLOPE * math.hypot(x - start[0], y - start[1])
    at_goal = margins[2] + RELAXED_SLOPE * math.hypot(x - goal[0], y - goal[1])
    return float(min(margins[0], at_start, at_goal))


@compiled
def _wrap(angle: float) -> float:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@compiled
def rest_is_free(
    distance: Field, x0: float, y0: float, resolution: float, samples: Array, circumscribed: float,
    state: Array, start: Array, goal: Array, any_yaw: bool, margins: Array, direction: float,
) -> bool:  # fmt: skip
    """Whether turn, straight line (forward or backward) and turn lead freely from a state to the goal."""
    dx, dy = goal[0] - state[0], goal[1] - state[1]
    length = math.hypot(dx, dy)
    bearing = math.atan2(dy, dx) if length > 1e-3 else state[2]
    if direction < 0 and length > 1e-3:
        bearing += math.pi
    need = needed(state[0], state[1], start, goal, margins)
    turn = _wrap(bearing - state[2])
    free = sweep_clearance(
        distance, x0, y0, resolution, samples, circumscribed, state[0], state[1], state[2], turn, need
    )
    if free < need:
        return False
    n = math.ceil(length / resolution) + 1
    for k in range(n + 1):
        x, y = state[0] + dx * k / n, state[1] + dy * k / n
        need = needed(x, y, start, goal, margins)
        if clearance(distance, x0, y0, resolution, samples, circumscribed, x, y, bearing, need) < need:
            return False
    if any_yaw:
        return True
    need = min(margins[0], margins[2])
    turn = _wrap(goal[2] - bearing)
    free = sweep_clearance(distance, x0, y0, resolution, samples, circumscribed, goal[0], goal[1], bearing, turn, need)
    return bool(free >= need)


class Search:
    """A search that is carried on in slices, so that no control tick waits for a long one.

    ``margins``: clearance asked for in general, at the start, at the goal. ``cost`` is the heuristic (cost to go of a
    circle); ``greed`` its weight.
    """

    def __init__(
        self, distance: Field, cost: Field, corner: tuple[float, float], resolution: float, samples: Array,
        radii: tuple[float, float], start: Array, goal: Array, any_yaw: bool, margins: Array, comfort: float,
        weight: float, greed: float, max_expansions: int,
    ) -> None:  # fmt: skip
        rows, columns = (math.ceil(n * resolution / BIN) + 1 for n in distance.shape)
        states = rows * columns * HEADINGS
        self._max_expansions = max_expansions
        spent = np.full(states, np.inf, dtype=np.float32)
        self._parent = np.full(states, -1, dtype=np.int32)
        closed = np.zeros(states, dtype=np.bool_)
        self._position = np.empty((states, 2), dtype=np.float32)
        self._travel = np.zeros(states, dtype=np.int8)
        keys = np.empty(7 * min(max_expansions, states) + 64, dtype=np.float64)
        items = np.empty(keys.size, dtype=np.int64)
        self._memory = (spent, self._parent, closed, self._position, self._travel, keys, items)
        self._problem = (
            distance, cost, *corner, resolution, samples, *radii, start, goal, any_yaw, margins, comfort, weight, greed,
        )  # fmt: skip
        self.expanded = 0
        self._size = _begin(
            distance, *corner, resolution, samples, radii[1], start, goal, margins, columns, spent, self._position,
            self._travel, keys, items,
        )  # fmt: skip
        self._columns = columns
        self._last, self._direction = -1, 1.0

    def run(self, expansions: int) -> int:
        """Expand so many more states: RUNNING, FOUND, EXHAUSTED, or CUT_SHORT by ``max_expansions``."""
        until = min(self.expanded + expansions, self._max_expansions)
        outcome, self._size, self.expanded, self._last, self._direction = _expand(
            *self._problem, self._columns, *self._memory, self._size, self.expanded, until
        )
        over = outcome == RUNNING and self.expanded >= self._max_expansions
        return CUT_SHORT if over else int(outcome)

    def way(self) -> tuple[Array, float]:
        """What was found: rows x, y, yaw, direction of travel to there (1, -1, 0 for a turn on the spot), and the
        direction of the rest that leads from the last row to the goal. The first row is where the way from the start,
        straight with the start's heading, ends.
        """
        return _trace(self._parent, self._position, self._travel, self._last), self._direction


@compiled
def _begin(
    distance: Field, x0: float, y0: float, resolution: float, samples: Array, circumscribed: float, start: Array,
    goal: Array, margins: Array, columns: int, spent: NDArray[np.float32], position: NDArray[np.float32],
    travel: NDArray[np.int8], keys: Array, items: NDArray[np.int64],
) -> int:  # fmt: skip
    """Puts the states that are reached straight from the start into the heap; returns its size."""
    heading = round(start[2] / TURN) % HEADINGS
    size = 0
    for gear in (1.0, -1.0):
        for n in range(FIRST_STEPS + 1):
            x = start[0] + gear * n * STEP * math.cos(start[2])
            y = start[1] + gear * n * STEP * math.sin(start[2])
            need = needed(x, y, start, goal, margins)
            if clearance(distance, x0, y0, resolution, samples, circumscribed, x, y, start[2], need) < need:
                break
            turn = _wrap(heading * TURN - start[2])
            free = sweep_clearance(distance, x0, y0, resolution, samples, circumscribed, x, y, start[2], turn, need)
            first = _bin(x, y, x0, y0, columns) * HEADINGS + heading
            price = n * STEP * (1.0 if gear > 0 else BACKWARD)
            if free < need or price >= spent[first]:
                continue
            spent[first] = price
            position[first, 0], position[first, 1] = x, y
            travel[first] = int(gear) if n > 0 else 0
            size = push(keys, items, size, price, first)
    return size


@compiled
def _expand(
    distance: Field, cost: Field, x0: float, y0: float, resolution: float, samples: Array, inscribed: float,
    circumscribed: float, start: Array, goal: Array, any_yaw: bool, margins: Array, comfort: float, weight: float,
    greed: float, columns: int, spent: NDArray[np.float32], parent: NDArray[np.int32], closed: NDArray[np.bool_],
    position: NDArray[np.float32], travel: NDArray[np.int8], keys: Array, items: NDArray[np.int64], size: int,
    expanded: int, until: int,
) -> tuple[int, int, int, int, float]:  # fmt: skip
    """A* from where the memory stands. Returns outcome, heap size, states expanded, the last state, its direction."""
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
        state[0], state[1], state[2] = position[index, 0], position[index, 1], _wrap(heading * TURN)
        ahead = math.hypot(goal[0] - state[0], goal[1] - state[1])
        if ahead < 0.5 or (ahead < 2.5 and expanded % 8 == 0):
            for direction in (1.0, -1.0):
                if direction < 0 and ahead > 0.5:
                    continue
                if rest_is_free(
                    distance, x0, y0, resolution, samples, circumscribed, state, start, goal, any_yaw, margins,
                    direction,
                ):  # fmt: skip
                    return FOUND, size, expanded, index, direction
        for move in range(8):
            gear, turn = _MOVES[move, 0], _MOVES[move, 1]
            new_heading = (heading + int(turn)) % HEADINGS
            middle = state[2] + 0.5 * turn * TURN
            x = state[0] + gear * STEP * math.cos(middle)
            y = state[1] + gear * STEP * math.sin(middle)
            i, j = math.floor((y - y0) / resolution), math.floor((x - x0) / resolution)
            if i < 0 or j < 0 or i >= distance.shape[0] or j >= distance.shape[1]:
                continue
            there = _bin(x, y, x0, y0, columns) * HEADINGS + new_heading
            if closed[there]:
                continue
            to_go = cost[i, j]
            if not math.isfinite(to_go):
                # The field keeps the general margin; near start and goal the lattice may use less.
                if needed(x, y, start, goal, margins) >= margins[0]:
                    continue
                to_go = ahead
            need = needed(x, y, start, goal, margins)
            yaw = state[2] + turn * TURN
            if clearance(distance, x0, y0, resolution, samples, circumscribed, x, y, yaw, need) < need:
                continue
            if clearance(
                distance, x0, y0, resolution, samples, circumscribed, 0.5 * (x + state[0]), 0.5 * (y + state[1]),
                middle, need,
            ) < need:  # fmt: skip
                continue
            if gear == 0.0:
                price = TURN_COST * TURN
            else:
                room = sample(distance, x0, y0, resolution, x, y) - 0.5 * resolution - inscribed
                price = STEP * crowding(room, comfort, weight) * (1.0 if gear > 0 else BACKWARD) + 0.01 * abs(turn)
                if travel[index] * gear < 0:
                    price += REVERSAL
            total = spent[index] + price
            if total < spent[there] - 1e-6:
                spent[there] = total
                parent[there] = index
                position[there, 0], position[there, 1] = x, y
                travel[there] = int(gear)
                if size >= keys.size:
                    return CUT_SHORT, size, expanded, -1, 1.0
                size = push(keys, items, size, total + greed * to_go, there)
    return EXHAUSTED, size, expanded, -1, 1.0


_MOVES = np.array(
    [[1, 0], [1, 1], [1, -1], [0, 1], [0, -1], [-1, 0], [-1, 1], [-1, -1]], dtype=np.float64
)  # gear, change of heading


@compiled
def _bin(x: float, y: float, x0: float, y0: float, columns: int) -> int:
    return math.floor((y - y0) / BIN) * columns + math.floor((x - x0) / BIN)


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
        path[k, 2] = _wrap((index % HEADINGS) * TURN)
        path[k, 3] = travel[index]
        index = parent[index]
    return path
