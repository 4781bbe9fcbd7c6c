"""Where the cells of a grid lie in the map."""

from __future__ import annotations

import math
from typing import NamedTuple

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


def _index(cells: float) -> int:
    return math.floor(min(max(cells, -FAR_CELL), FAR_CELL))
