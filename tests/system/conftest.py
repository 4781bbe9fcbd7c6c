"""Cells for system tests, beside the fixtures of ``rackhand.testing.plugin``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from rackhand.testing import Cell
from tests.system.station import Station, pick_station


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.system)


@pytest.fixture(scope="module")
def real_time_cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cell]:
    """One cell for all tests of a module: world ``warehouse`` at real time, which leaves the machine to the tests."""
    with Cell(tmp_path_factory.mktemp("cell"), lockstep=False) as cell:
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
