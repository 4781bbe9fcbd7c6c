"""Where a way that cannot be driven is too narrow: the widest one between two places, and its tightest place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.map.grid import Mask
from rackhand.services.planner.planning.field import distance_field

AROUND = 10.0  # m about start and goal in which ways are looked for
MOST_CELLS = 2_000_000
HALVINGS = 6  # of the radius that is looked for
NOTHING = 1e-6  # m; the radius of a disc that passes wherever a cell is free
FIRST = 1e-2  # cells a cell: of places that are equally narrow, the first on the way
EIGHT = np.ones((3, 3), dtype=np.bool_)  # neighbours of a cell
STRAIGHT = 1e-3  # and of these the one nearest to the straight line

Labels = NDArray[np.signedinteger]
Field = NDArray[np.float32]


@dataclass(frozen=True)
class Bottleneck:
    """The tightest place of the widest way: a disc of ``radius`` metres passes ``x``, ``y``, 0 where nothing does.
    ``blocked_x``, ``blocked_y``: the middle of the blocked cell nearest to it."""

    x: float
    y: float
    radius: float
    blocked_x: float
    blocked_y: float


def bottleneck(
    blocked: Mask, g: Geometry, start: tuple[float, float], goal: tuple[float, float], needed: float
) -> Bottleneck | None:
    """What keeps a disc of radius ``needed`` metres from driving from ``start`` to ``goal``.

    The widest way is found by halving: the largest radius at which both places are in one part of the free space. Ways
    that leave the surroundings of start and goal are not looked at. Where only one of the places themselves has less
    room than the disc needs, that place is the answer. None where the disc has a way, where a place is off the map or
    has no room at all, or where there are too many cells.
    """
    low, high = np.minimum(start, goal) - AROUND, np.maximum(start, goal) + AROUND
    window = g.window((low[0], low[1]), (high[0], high[1]))
    part = Geometry(
        g.x + window[1].start * g.resolution,
        g.y + window[0].start * g.resolution,
        g.resolution,
        window[0].stop - window[0].start,
        window[1].stop - window[1].start,
    )
    if part.rows * part.columns > MOST_CELLS or not (part.contains(*start) and part.contains(*goal)):
        return None
    here, there = part.cell(*start), part.cell(*goal)
    walls = np.ascontiguousarray(blocked[window])
    room = distance_field(walls, g.resolution) - np.float32(0.5 * g.resolution)
    narrower = here if room[here] < room[there] else there
    at_ends = float(room[narrower])
    if at_ends <= 0.0:
        return None
    apart = _labels(room, min(needed, at_ends))
    if apart[here] == apart[there]:
        return _at(room, narrower, at_ends, part) if at_ends < needed else None
    passable, apart, radius = _widest(room, here, there, min(needed, at_ends))
    return _tightest(room, apart, passable, (here, there), radius, part)


def _widest(room: Field, here: tuple[int, int], there: tuple[int, int], needed: float) -> tuple[Mask, Labels, float]:
    """The cells of the part that joins both places, the parts that are apart for a disc that is hardly larger, and the
    radius of the disc that passes; all cells and 0 where none does."""
    labels = _labels(room, NOTHING)
    if labels[here] != labels[there]:
        return np.ones(room.shape, dtype=np.bool_), labels, 0.0
    low, high = NOTHING, needed
    joined, apart = labels == labels[here], _labels(room, needed)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        labels = _labels(room, middle)
        if labels[here] == labels[there]:
            low, joined = middle, labels == labels[here]
        else:
            high, apart = middle, labels
    return joined, apart, low


def _tightest(
    room: Field,
    apart: Labels,
    passable: Mask,
    ends: tuple[tuple[int, int], tuple[int, int]],
    radius: float,
    g: Geometry,
) -> Bottleneck:
    """Of the cells that may be passed, one on the shortest way between the part of the start and that of the goal."""
    (r0, c0), (r1, c1) = ends
    between = _between(passable, apart == apart[ends[0]], apart == apart[ends[1]])
    from_start, to_goal = (distance_field(apart == apart[end], 1.0) for end in ends)
    rows, columns = np.indices(room.shape)
    length = max(math.hypot(r1 - r0, c1 - c0), 1e-9)
    off_line = np.abs((r1 - r0) * (columns - c0) - (c1 - c0) * (rows - r0)) / length
    cost = np.where(between, (1.0 + FIRST) * from_start + to_goal + STRAIGHT * off_line, np.inf)
    row, column = np.unravel_index(int(cost.argmin()), room.shape)
    return _at(room, (int(row), int(column)), radius, g)


def _at(room: Field, cell: tuple[int, int], radius: float, g: Geometry) -> Bottleneck:
    x, y = g.centre(*cell)
    rows, columns = np.nonzero(room < 0.0)
    k = int(np.hypot(rows - cell[0], columns - cell[1]).argmin())
    blocked_x, blocked_y = g.centre(int(rows[k]), int(columns[k]))
    return Bottleneck(x, y, radius, blocked_x, blocked_y)


def _between(passable: Mask, start: Mask, goal: Mask) -> Mask:
    """The passages that lead from the part of the start to that of the goal: what is narrow beside only one of them, as
    the rim of a room along a wall, leads nowhere though the other part may be near behind that wall."""
    passages, number = ndimage.label(passable & ~start & ~goal, structure=EIGHT)
    beside = [
        np.bincount(passages[ndimage.binary_dilation(part, EIGHT)], minlength=number + 1) for part in (start, goal)
    ]
    through = (beside[0] > 0) & (beside[1] > 0)
    through[0] = False
    found: Mask = through[passages]
    return found if found.any() else passable


def _labels(room: Field, radius: float) -> Labels:
    """The parts of the space in which a disc can be, by number; 0 where it cannot."""
    labels: Labels = ndimage.label(room >= radius, structure=EIGHT)[0]
    return labels
