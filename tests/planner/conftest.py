from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from rackhand.services.planner.settings import NavigationSettings
from tests.planner.fakes import Cell
from tests.planner.plant import Hall, Plant, Robot, Walker, box, idle


@pytest.fixture
def make_cell(tmp_path: Path) -> Iterator[Callable[..., Cell]]:
    cells: list[Cell] = []

    def make(**fields: Any) -> Cell:
        cells.append(Cell(**({"path": tmp_path / f"store{len(cells)}.sqlite"} | fields)))
        return cells[-1]

    yield make
    for cell in cells:
        cell.database.close()
        cell.executor.shutdown()


@pytest.fixture
def cell(make_cell: Callable[..., Cell]) -> Cell:
    return make_cell()


def small_hall() -> Hall:
    """10 x 8 m with one mapped block in the middle."""
    return Hall(10, 8, [box(5, 4, 1, 2)])


@pytest.fixture
def begin() -> Callable[..., tuple[Robot, Plant]]:
    """A robot and its plant that have run for 0.4 s."""

    def make(
        hall: Hall | None = None,
        pose: tuple[float, float, float] = (1.5, 4.0, 0.0),
        settings: NavigationSettings | None = None,
        seed: int = 1,
        crates: tuple = (),
        walkers: tuple[Walker, ...] = (),
    ) -> tuple[Robot, Plant]:
        plant = Plant(hall or small_hall(), pose, seed)
        plant.crates = list(crates)
        plant.walkers = list(walkers)
        robot = Robot(plant, settings)
        idle(robot, plant, 0.4)
        return robot, plant

    return make
