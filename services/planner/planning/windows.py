"""Plans on maps of any size: in a window about start and goal, and in a larger one only where that may be shorter.

A path that leaves a window is at least as long as the ways from the start to one of its sides and from there to the
goal. A path within it that costs no more is the best of the whole map, however large that is.

Where the last window has more than ``LARGEST`` cells the search is coarse to fine: first on cells of ``COARSE`` m or
more for a guide to the goal, then in the map's own cells to a place on the guide, from where the rest is planned when
the chassis comes near.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.map.grid import Mask
from rackhand.services.planner.planning.corridor import Corridor
from rackhand.services.planner.planning.plan import GlobalPlanner, NoPathFound, Search, Segment, Target
from rackhand.services.planner.settings import NavigationSettings

MARGINS = (8.0, 30.0)  # m about start and goal; then the whole map
CORRIDOR_MARGIN = 2.0  # m about what a footprint in a corridor may cover
LARGEST = 9_000_000  # cells that are searched at once: about 2 s
COARSE_CELLS = 2_000_000
HORIZON = 40.0  # m of guide from the start, up to which a plan is made in the map's own cells

Window = tuple[slice, slice]


class LargePlanner:
    """Plans on one map for one footprint, as ``GlobalPlanner`` does."""

    def __init__(
        self,
        geometry: Geometry,
        static: Mask,
        observed: NDArray[np.int64],
        footprint: Footprint,
        settings: NavigationSettings,
    ) -> None:
        """``static``: cells (rows, columns) that the footprint must not touch; ``observed``: flat indices of more."""
        self._geometry, self._static, self._observed = geometry, static, observed
        self._footprint, self._settings = footprint, settings

    def search(self, start: Pose, target: Target, tight: bool = False, corridor: Corridor | None = None) -> Search:
        """Search in slices, as ``GlobalPlanner.search``."""
        if not self._geometry.contains(target.x, target.y):
            raise NoPathFound("disconnected", f"the goal ({target.x:.2f}, {target.y:.2f}) is outside the map")
        if corridor is not None:
            window = self._around(corridor, start, target)
            planner = GlobalPlanner(part(self._geometry, window), self._footprint, self._settings)
            return (yield from planner.search(start, target, self._blocked(window), tight, corridor))
        for window in windows(self._geometry, start, target):
            whole = _size(window) == self._static.size
            if _size(window) > LARGEST:
                return (yield from self._coarse_to_fine(start, target, tight))
            try:
                plan = yield from self._in(window, start, target, tight)
            except NoPathFound:
                if whole:
                    raise
                continue
            if whole or plan.start_cost <= way_out(self._geometry, window, start, target):
                return plan
        raise AssertionError("the last window is the whole map")

    def _around(self, corridor: Corridor, start: Pose, target: Target) -> Window:
        """The window that holds a corridor, and what the footprint covers beside it."""
        ends = np.vstack([corridor.line, start[None, :2], target.pose[None, :2]])
        low, high = ends.min(axis=0), ends.max(axis=0)
        margin = corridor.width + self._footprint.circumscribed + CORRIDOR_MARGIN
        return about(self._geometry, np.array([*low, 0.0]), Target(float(high[0]), float(high[1]), None), margin)

    def _in(self, window: Window, start: Pose, target: Target, tight: bool) -> Search:
        geometry = part(self._geometry, window)
        planner = GlobalPlanner(geometry, self._footprint, self._settings)
        return (yield from planner.search(start, target, self._blocked(window), tight))

    def _blocked(self, window: Window) -> Mask:
        blocked = self._static[window].copy()
        rows, columns = np.divmod(self._observed, self._geometry.columns)
        rows, columns = rows - window[0].start, columns - window[1].start
        inside = (rows >= 0) & (rows < blocked.shape[0]) & (columns >= 0) & (columns < blocked.shape[1])
        blocked[rows[inside], columns[inside]] = True
        return blocked

    def _coarse_to_fine(self, start: Pose, target: Target, tight: bool) -> Search:
        guide = yield from self._guide(start, target)
        points = np.vstack([segment.points for segment in guide.segments])
        travelled = np.append(0.0, np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T)))
        via = int(np.searchsorted(travelled, HORIZON))
        if via >= len(points) - 1:
            raise NoPathFound("budget", "start and goal are near, but the way between them is long and winding")
        place = Target(float(points[via, 0]), float(points[via, 1]), None, target.rotate_in_place)
        window = about(self._geometry, start, place, MARGINS[-1])
        plan = yield from self._in(window, start, place, tight)
        rest = Segment(points[via:])
        return replace(plan, segments=(*plan.segments, rest), open_from=len(plan.segments))

    def _guide(self, start: Pose, target: Target) -> Search:
        """A path on cells so coarse that the map has ``COARSE_CELLS``: blocked where any of their part is, and where
        that leaves no path, only where all of it is."""
        k = math.ceil(math.sqrt(self._static.size / COARSE_CELLS))
        g, everything = self._geometry, (slice(0, self._geometry.rows), slice(0, self._geometry.columns))
        rows, columns = g.rows // k, g.columns // k
        cells = self._blocked(everything)[: rows * k, : columns * k].reshape(rows, k, columns, k)
        coarse = Geometry(g.x, g.y, k * g.resolution, rows, columns)
        circle = _disc(self._footprint.inscribed)
        choices: tuple[Mask, Mask] = np.asarray(cells.any(axis=(1, 3))), np.asarray(cells.all(axis=(1, 3)))
        for blocked in choices:
            for end in (start, target.pose):
                _free_about(blocked, coarse, end)
            planner = GlobalPlanner(coarse, circle, self._settings)
            try:
                return (yield from planner.search(start, replace(target, yaw=None), blocked))
            except NoPathFound as none:
                last = none
        raise last


def windows(g: Geometry, start: Pose, target: Target) -> Iterator[Window]:
    """Ever larger windows about start and goal; the last one is the whole map."""
    whole = slice(0, g.rows), slice(0, g.columns)
    for margin in MARGINS:
        window = about(g, start, target, margin)
        if 2 * _size(window) < g.rows * g.columns:
            yield window
    yield whole


def about(g: Geometry, start: Pose, target: Target, margin: float) -> Window:
    """The rows and columns of the map within ``margin`` metres of the box of start and goal."""
    low = g.cell(min(start[0], target.x) - margin, min(start[1], target.y) - margin)
    high = g.cell(max(start[0], target.x) + margin, max(start[1], target.y) + margin)
    sides = zip(low, high, (g.rows, g.columns), strict=True)
    rows, columns = (slice(min(max(a, 0), n - 1), max(min(b + 1, n), 1)) for a, b, n in sides)
    return rows, columns


def way_out(g: Geometry, window: Window, start: Pose, target: Target) -> float:
    """The least length in metres of a path from start to goal that leaves the window; infinite where it cannot."""
    inner = part(g, window)
    least = math.inf
    for axis, size, n, first in ((0, inner.columns, g.columns, window[1]), (1, inner.rows, g.rows, window[0])):
        low, ends = (inner.x, inner.y)[axis], (start[axis], (target.x, target.y)[axis])
        if first.start > 0:
            least = min(least, sum(end - low for end in ends))
        if first.stop < n:
            least = min(least, sum(low + size * g.resolution - end for end in ends))
    return least


def part(g: Geometry, window: Window) -> Geometry:
    """The geometry of a window."""
    rows, columns = window
    x, y = g.x + columns.start * g.resolution, g.y + rows.start * g.resolution
    return Geometry(x, y, g.resolution, rows.stop - rows.start, columns.stop - columns.start)


def _size(window: Window) -> int:
    return int((window[0].stop - window[0].start) * (window[1].stop - window[1].start))


def _free_about(blocked: Mask, g: Geometry, pose: Pose) -> None:
    """Where the chassis is, and where its goal is: the fine cells say whether it fits."""
    row, column = g.cell(pose[0], pose[1])
    blocked[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = False


def _disc(radius: float) -> Footprint:
    angles = np.linspace(0.0, math.tau, 16, endpoint=False)
    return Footprint.of(radius * np.column_stack([np.cos(angles), np.sin(angles)]))
