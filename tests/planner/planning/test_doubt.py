from __future__ import annotations

import numpy as np

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.planning.doubt import still_there

GRID = Geometry(0.0, 0.0, 0.05, 40, 60)


def block(row: int, column: int) -> np.ndarray:
    """The cells of a crate of 0.4 m."""
    rows, columns = np.mgrid[row : row + 8, column : column + 8]
    return (rows * GRID.columns + columns).ravel()


def test_a_crate_of_which_one_side_is_seen_is_there_as_a_whole_and_one_that_is_not_seen_is_doubted() -> None:
    seen, unseen = block(5, 5), block(5, 25)
    kept = still_there(np.concatenate([unseen, seen]), seen[:8], GRID)
    assert sorted(kept) == sorted(seen)


def test_nothing_observed_and_nothing_seen() -> None:
    nothing = np.empty(0, dtype=np.int64)
    assert len(still_there(nothing, nothing, GRID)) == 0
    assert len(still_there(block(5, 5), nothing, GRID)) == 0
