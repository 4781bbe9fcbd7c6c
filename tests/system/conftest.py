"""Cells for system tests. A test that fails shows the last lines of its cell's log."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.system.cell import Cell
from tests.system.station import Station, pick_station

MakeCell = Callable[..., Cell]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.system)


@pytest.fixture
def make_cell(tmp_path: Path) -> Iterator[MakeCell]:
    """``make_cell("--world", "empty", "--speed", "max")`` is a cell that is up; it ends with the test."""
    with ExitStack() as cells:
        made = 0

        def make(*options: str, **settings: Any) -> Cell:
            nonlocal made
            made += 1
            return cells.enter_context(Cell(tmp_path / f"cell{made}", *options, **settings))

        yield make


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cell]:
    """One cell for all tests of a module: world ``warehouse`` at real time, which leaves the machine to the tests."""
    with Cell(tmp_path_factory.mktemp("cell")) as cell:
        yield cell


@pytest.fixture(scope="module")
def ur5e_station(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    """One cell for all tests of a module: the pick station, in lockstep and paused."""
    with pick_station(tmp_path_factory.mktemp("cell")) as station:
        yield station


@pytest.fixture
def station(ur5e_station: Station) -> Station:
    """The arm at rest at home, nobody's, nothing latched."""
    return ur5e_station.reset()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    outcome: Any = yield
    report = outcome.get_result()
    if report.failed:
        given = getattr(item, "funcargs", {}).values()
        given = [value[0] if isinstance(value, tuple) else value for value in given]
        folders = [value.cell if isinstance(value, Station) else value for value in given]
        folders = [value for value in folders if isinstance(value, Cell)]
        report.sections += [("log of the cell", cell.tail()) for cell in folders]
