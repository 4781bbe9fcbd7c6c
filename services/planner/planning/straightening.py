"""Fewer bends in a path of the search with the footprint: its arcs and headings of 15 degrees lead to and fro where a
straight line is free."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled, compiled_nogil
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import wrap
from rackhand.services.planner.planning.distance_grid import DistanceGrid, clearance, turn_clearance
from rackhand.services.planner.planning.lattice import Ends, Problem, needed
from rackhand.services.planner.planning.shaping import COST_SLACK, cost_along, line_cost

Array = NDArray[np.float64]
MOST_BEND = 0.35  # rad between two lines that are driven without stopping
SPACING = 0.05  # m between the points of a line
EACH, EVERY = 40, 4  # rows ahead that are tried as the end of a line, and which of those farther ahead
ROUNDS = 30  # of the elastic band that rounds the bends
KEPT_CLEARANCE = 0.1  # m of clearance that is not given up for a straighter path
GIVEN = 0.005  # m less of it than the path had
STILL = 5e-4  # m, less than which a point need not move
SAME_PLACE = 1e-6  # m


def straightened(
    problem: Problem,
    rows: Array,
    backward: bool,
    turn_to: float | None,
    is_last: bool,
) -> list[Array]:
    """Rows x, y, yaw that are driven in one direction, as parts between which the chassis turns on the spot.

    Lines replace what costs more than they do, where the footprint has the clearance asked for and no less than what
    they replace; bends are rounded then.
    The first step stays. ``rows``: (n, 3); two at the same place are a turn on the spot. ``turn_to``: heading to which
    the chassis turns at the end, None for none. ``is_last``: the end is the goal, to which any heading leads.
    """
    sign = -1.0 if backward else 1.0
    end_yaw = math.nan if turn_to is None else turn_to
    lines = _lines(problem, rows, sign, end_yaw, is_last)
    band = _rounded(problem.grid, problem.footprint, problem.ends, lines, sign)
    steps = np.hypot(*np.diff(band[:, :2], axis=0).T)
    return [part for part in np.split(band, np.nonzero(steps < SAME_PLACE)[0] + 1) if len(part) > 1]


@compiled_nogil
def _lines(problem: Problem, rows: Array, sign: float, end_yaw: float, is_last: bool) -> Array:
    n = len(rows)
    cost = cost_along(problem.grid, problem.inflation, rows)
    room = np.empty(n)
    for k in range(n):
        room[k] = clearance(problem.grid, problem.footprint, rows[k, 0], rows[k, 1], rows[k, 2], KEPT_CLEARANCE)
    found = np.empty((2 * n + 2, 3))
    m = min(n, 2)
    found[:m] = rows[:m]
    here, yaw = m - 1, rows[m - 1, 2]
    while here < n - 1:
        reach = _reach(problem, rows, cost, room, here, yaw, sign, end_yaw, is_last)
        if reach == here + 1:
            found[m] = rows[reach]
            m += 1
            yaw = rows[reach, 2]
        else:
            dx, dy = rows[reach, 0] - rows[here, 0], rows[reach, 1] - rows[here, 1]
            yaw = math.atan2(sign * dy, sign * dx)
            steps = max(1, math.ceil(math.hypot(dx, dy) / SPACING))
            for k in range(1, steps + 1):
                found[m, 0] = rows[here, 0] + dx * k / steps
                found[m, 1] = rows[here, 1] + dy * k / steps
                found[m, 2] = yaw
                m += 1
        here = reach
    return found[:m].copy()


@compiled
def _reach(
    problem: Problem,
    rows: Array,
    cost: Array,
    room: Array,
    here: int,
    yaw: float,
    sign: float,
    end_yaw: float,
    is_last: bool,
) -> int:
    """The farthest row to which a line leads from row ``here``, where the heading is ``yaw``; the next one for none."""
    grid, _, footprint, inflation, ends, _ = problem
    n = len(rows)
    least = np.minimum(room, KEPT_CLEARANCE)
    for k in range(here + 1, n):
        least[k] = min(least[k], least[k - 1])
    for k in range(n - 1, here + 1, -1):
        if k - here > EACH and k % EVERY != 0 and k != n - 1:
            continue
        dx, dy = rows[k, 0] - rows[here, 0], rows[k, 1] - rows[here, 1]
        length = math.hypot(dx, dy)
        line = math.atan2(sign * dy, sign * dx)
        bend = abs(wrap(line - yaw))
        if not (is_last and k == n - 1):
            bend = max(bend, abs(wrap(line - rows[k, 2])))
        if length < SAME_PLACE or bend > MOST_BEND:
            continue
        if line_cost(grid, inflation, rows[here, :2], rows[k, :2]) > (cost[k] - cost[here]) * COST_SLACK:
            continue
        if not _is_line_free(problem, rows[here], dx, dy, line, least[k] - GIVEN):
            continue
        turn = 0.0
        if k == n - 1:
            turn = 0.0 if math.isnan(end_yaw) else wrap(end_yaw - line)
        elif math.hypot(rows[k + 1, 0] - rows[k, 0], rows[k + 1, 1] - rows[k, 1]) < SAME_PLACE:
            turn = wrap(rows[k, 2] - line)
        need = needed(rows[k, 0], rows[k, 1], ends)
        if turn == 0.0 or turn_clearance(grid, footprint, rows[k, 0], rows[k, 1], line, turn, need) >= need:
            return k
    return here + 1


@compiled
def _is_line_free(problem: Problem, begin: Array, dx: float, dy: float, yaw: float, kept: float) -> bool:
    """Whether the footprint has the clearance asked for, and at least ``kept`` metres, all along."""
    grid, _, footprint, _, ends, _ = problem
    steps = math.ceil(math.hypot(dx, dy) / SPACING)
    for k in range(steps + 1):
        x, y = begin[0] + dx * k / steps, begin[1] + dy * k / steps
        need = max(needed(x, y, ends), kept)
        if clearance(grid, footprint, x, y, yaw, need) < need:
            return False
    return True


@compiled_nogil
def _rounded(grid: DistanceGrid, footprint: Footprint, ends: Ends, rows: Array, sign: float) -> Array:
    """The rows as an elastic band: each is drawn to the middle of its neighbours where the footprint stays free, and
    has the heading of the way to the next. The first and last two, and those at turns on the spot, stay."""
    band = rows.copy()
    n = len(band)
    is_fixed = np.zeros(n, dtype=np.bool_)
    for k in range(n):
        is_fixed[k] = k < 2 or k > n - 3 or _is_turn(band, k - 1) or _is_turn(band, k)
    for _ in range(ROUNDS):
        for k in range(2, n - 2):
            if not is_fixed[k]:
                _draw(grid, footprint, ends, band, k, sign)
    for k in range(n - 1):
        if not _is_turn(band, k):
            band[k, 2] = _heading(band, k, k + 1, sign)
        elif k > 0 and not _is_turn(band, k - 1):
            band[k, 2] = _heading(band, k - 1, k, sign)
    if n > 1 and not _is_turn(band, n - 2):
        band[n - 1, 2] = _heading(band, n - 2, n - 1, sign)
    return band


@compiled
def _draw(grid: DistanceGrid, footprint: Footprint, ends: Ends, band: Array, k: int, sign: float) -> None:
    x, y = band[k, 0], band[k, 1]
    there_x, there_y = 0.5 * (band[k - 1, 0] + band[k + 1, 0]), 0.5 * (band[k - 1, 1] + band[k + 1, 1])
    if math.hypot(there_x - x, there_y - y) < STILL:
        return
    yaw = _heading(band, k - 1, k + 1, sign)
    before = clearance(grid, footprint, x, y, yaw, KEPT_CLEARANCE)
    after = clearance(grid, footprint, there_x, there_y, yaw, KEPT_CLEARANCE)
    if after < min(before, KEPT_CLEARANCE):
        return
    band[k, 0], band[k, 1] = there_x, there_y
    for m in (k - 1, k, k + 1):
        need = needed(band[m, 0], band[m, 1], ends)
        yaw = _heading(band, m - 1, m + 1, sign)
        if clearance(grid, footprint, band[m, 0], band[m, 1], yaw, need) < need:
            band[k, 0], band[k, 1] = x, y
            return


@compiled
def _is_turn(rows: Array, k: int) -> bool:
    """Whether the chassis turns on the spot between this row and the next."""
    if k < 0 or k + 1 >= len(rows):
        return False
    return math.hypot(rows[k + 1, 0] - rows[k, 0], rows[k + 1, 1] - rows[k, 1]) < SAME_PLACE


@compiled
def _heading(rows: Array, begin: int, end: int, sign: float) -> float:
    return math.atan2(sign * (rows[end, 1] - rows[begin, 1]), sign * (rows[end, 0] - rows[begin, 0]))
