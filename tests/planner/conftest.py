from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.planner.fakes import Cell


@pytest.fixture
def make_cell(tmp_path: Path) -> Iterator[Callable[..., Cell]]:
    cells: list[Cell] = []

    def make(**fields: Any) -> Cell:
        cells.append(Cell(**({"path": tmp_path / f"store{len(cells)}.sqlite"} | fields)))
        return cells[-1]

    yield make
    for cell in cells:
        cell.database.close()


@pytest.fixture
def cell(make_cell: Callable[..., Cell]) -> Cell:
    return make_cell()
