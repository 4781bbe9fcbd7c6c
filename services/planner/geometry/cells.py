"""Where the cells of a grid lie in the map."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.services.planner.geometry.polygon import inside_convex

FAR_CELL = 2.0**40  # beyond any grid, and small enough for whole numbers everywhere


class Geometry(NamedTuple):
    """Lower-left corner ``x``, ``y`` and cell size ``resolution`` in metres; size in cells.

    Arrays over it have the shape (rows, columns) and are indexed [row = y, column = x].
    """

    x: float
    y: float
    resolution: float
    rows: int
    columns: int

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """The row and column of the cell that holds a point; may lie outside the grid, at most ``FAR_CELL`` away."""
        return _index((y - self.y) / self.resolution), _index((x - self.x) / self.resolution)

    def contains(self, x: float, y: float) -> bool:
        row, column = self.cell(x, y)
        return 0 <= row < self.rows and 0 <= column < self.columns

    def centre(self, row: int, column: int) -> tuple[float, float]:
        return self.x + (column + 0.5) * self.resolution, self.y + (row + 0.5) * self.resolution

    def window(self, low: tuple[float, float], high: tuple[float, float]) -> tuple[slice, slice]:
        """Rows and columns of the cells between two corners, in metres; empty beside the grid."""
        (r0, c0), (r1, c1) = self.cell(*low), self.cell(*high)
        rows = slice(min(max(r0, 0), self.rows), min(max(r1 + 1, 0), self.rows))
        return rows, slice(min(max(c0, 0), self.columns), min(max(c1 + 1, 0), self.columns))

    def centres(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Centres of the cells with these flat indices, (n, 2)."""
        rows, columns = np.divmod(cells, self.columns)
        return np.column_stack([self.x + (columns + 0.5) * self.resolution, self.y + (rows + 0.5) * self.resolution])


def cells_in(geometry: Geometry, polygon: NDArray[np.float64]) -> NDArray[np.int64]:
    """Flat indices of the cells whose centre is inside a convex polygon, (n, 2) in metres."""
    cells, centres = _window(geometry, polygon.min(axis=0), polygon.max(axis=0))
    kept: NDArray[np.int64] = cells[inside_convex(polygon, centres)]
    return kept


def cells_near(geometry: Geometry, point: NDArray[np.float64], reach: float) -> NDArray[np.int64]:
    """Flat indices of the cells whose centre is within ``reach`` metres of a point, (2,)."""
    cells, centres = _window(geometry, point - reach, point + reach)
    kept: NDArray[np.int64] = cells[np.hypot(*(centres - point).T) <= reach]
    return kept


def _window(
    g: Geometry, low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Flat indices of all cells between two corners, and their centres (n, 2)."""
    along_y, along_x = g.window((low[0], low[1]), (high[0], high[1]))
    rows, columns = np.mgrid[along_y, along_x]
    cells: NDArray[np.int64] = (rows * g.columns + columns).ravel()
    return cells, g.centres(cells)


def _index(cells: float) -> int:
    return math.floor(min(max(cells, -FAR_CELL), FAR_CELL))
