"""Which of the things that were observed are still there, when only some of their cells were seen lately."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from rackhand.services.planner.geometry.cells import Geometry

GAP = 0.25  # m between cells of one thing

Cells = NDArray[np.int64]


def still_there(cells: Cells, seen: Cells, geometry: Geometry) -> Cells:
    """Those of the ``cells`` whose thing has one that is ``seen``: of a crate the beams meet one side only.

    Both are flat indices of a map's cells; a thing is what has no gap of more than ``GAP``.
    """
    if not len(cells):
        return cells
    pairs = cKDTree(geometry.centres(cells)).query_pairs(GAP, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), dtype=np.bool_), pairs.T), shape=(len(cells), len(cells)))
    _, things = connected_components(links, directed=False)
    kept: Cells = cells[np.isin(things, things[np.isin(cells, seen)])]
    return kept
