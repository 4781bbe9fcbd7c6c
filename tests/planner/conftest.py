from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from rackhand.services.planner.behaviors.navigator import ChassisNavigator
from rackhand.services.planner.settings import NavigationSettings
from tests.chassis_models import chassis_model
from tests.planner.fakes import Cell
from tests.planner.plant import BODY, Hall, Plant, Walker, box, idle


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


def small_hall() -> Hall:
    """10 x 8 m with one mapped block in the middle."""
    return Hall(10, 8, [box(5, 4, 1, 2)])


@pytest.fixture
def begin() -> Callable[..., tuple[ChassisNavigator, Plant]]:
    """A navigator and a plant that have known each other for 0.4 s."""

    def make(
        hall: Hall | None = None,
        pose: tuple[float, float, float] = (1.5, 4.0, 0.0),
        settings: NavigationSettings | None = None,
        seed: int = 1,
        crates: tuple = (),
        walkers: tuple[Walker, ...] = (),
    ) -> tuple[ChassisNavigator, Plant]:
        navigator = ChassisNavigator(settings)
        plant = Plant(hall or small_hall(), pose, seed)
        plant.crates = list(crates)
        plant.walkers = list(walkers)
        navigator.set_map(plant.hall.map())
        navigator.set_model(chassis_model(BODY))
        idle(navigator, plant, 0.4)
        return navigator, plant

    return make
