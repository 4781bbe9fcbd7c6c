"""pytest plugin: a running cell for your tests.

``pytest.ini``::

    [pytest]
    rackhand_world = warehouse          # a world's name, or a folder relative to the ini file
    rackhand_seed = 7
    rackhand_options = --robot-profile longjack

A test asks for fixtures::

    def test_my_client_survives_a_blind_lidar(cell, world):
        world.fault("lidar_blind", "amr1")
        assert my_client.drive(cell.http, 5.5, 7.5) == "failed"

* ``cell``: a ``Cell``, reset before each test. One cell serves all tests that want the same options.
* ``world``: the same cell as a ``WorldControl``: time, obstacles, faults, ground truth.
* ``chassis``: a client of the chassis API; ``arm``: a client of the first arm.
* ``make_cell``: starts further cells, which end with the test.

``@pytest.mark.rackhand(world="pick_station", seed=3)`` on a test, class or module gives it a cell with these arguments
of ``Cell``. Tests with different arguments follow each other best in blocks: only one such cell runs at a time.
The report of a failed test ends with the last lines of its cell's log.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from rackhand.testing.arm import Arm
    from rackhand.testing.cell import Cell
    from rackhand.testing.chassis import Chassis
    from rackhand.testing.world import WorldControl

MakeCell = Callable[..., "Cell"]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addini("rackhand_world", "world of the cell: a name, or a folder relative to the ini file", default="")
    parser.addini("rackhand_seed", "seed of all noise of the cell", default="")
    parser.addini("rackhand_options", "further options of `rackhand up` for the cell", default="")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "rackhand(**arguments): the arguments of the Cell that this test runs against")


class CellPool:
    """Keeps one cell running, and replaces it when a test wants another one."""

    def __init__(self, new_folder: Callable[[], Path]) -> None:
        self._new_folder = new_folder
        self._wanted: tuple[tuple[str, ...], dict[str, Any]] | None = None
        self._open = ExitStack()
        self._cell: Cell | None = None

    def get(self, options: tuple[str, ...], arguments: dict[str, Any]) -> Cell:
        from rackhand.testing.cell import Cell

        if self._cell is None or self._cell.supervisor.poll() is not None or self._wanted != (options, arguments):
            self.close()
            self._cell = self._open.enter_context(Cell(self._new_folder(), *options, **arguments))
            self._wanted = (options, arguments)
        return self._cell

    def close(self) -> None:
        self._open.close()
        self._cell = None


@pytest.fixture(scope="session")
def rackhand_cells(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CellPool]:
    """The cell that tests share."""
    pool = CellPool(lambda: tmp_path_factory.mktemp("cell"))
    yield pool
    pool.close()


@pytest.fixture
def cell(request: pytest.FixtureRequest, rackhand_cells: CellPool) -> Iterator[Cell]:
    """A cell in lockstep whose world has just begun, and whose time runs."""
    from rackhand.testing.fresh import freshen

    marks = list(request.node.iter_markers("rackhand"))[::-1]  # the closest mark wins
    arguments = {**_from_ini(request.config), **{key: value for mark in marks for key, value in mark.kwargs.items()}}
    cell = rackhand_cells.get(tuple(shlex.split(request.config.getini("rackhand_options"))), arguments)
    freshen(cell, arguments.get("seed"))
    cell.resume()
    yield cell
    if cell.supervisor.poll() is None and cell.health() is not None:
        cell.pause()  # costs nothing until the next test


@pytest.fixture
def world(cell: Cell) -> WorldControl:
    """Time, obstacles, faults and ground truth of the cell."""
    return cell


@pytest.fixture
def chassis(cell: Cell) -> Iterator[Chassis]:
    """A client of the chassis API of the cell."""
    from rackhand.testing.chassis import Chassis

    with Chassis(cell) as chassis:
        yield chassis


@pytest.fixture
def arm(cell: Cell) -> Iterator[Arm]:
    """A client of the first arm of the cell."""
    from rackhand.testing.arm import Arm

    if not cell.crf:
        pytest.fail("the world of this cell has no arm; choose one that has with rackhand_world")
    with Arm(cell, next(iter(cell.crf))) as arm:
        arm.wait_until_ready()
        yield arm


@pytest.fixture
def make_cell(tmp_path: Path) -> Iterator[MakeCell]:
    """``make_cell(world="empty", seed=3)`` is a further cell that is up; it ends with the test."""
    from rackhand.testing.cell import Cell

    with ExitStack() as cells:
        made = 0

        def make(*options: str, **arguments: Any) -> Cell:
            nonlocal made
            made += 1
            return cells.enter_context(Cell(tmp_path / f"cell{made}", *options, **arguments))

        yield make


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    outcome: Any = yield
    report = outcome.get_result()
    if report.failed:
        report.sections += [("log of the cell", cell.tail()) for cell in _cells_of(item)]


def _cells_of(item: pytest.Item) -> list[Cell]:
    """The cells among the fixtures of a test, also those that a client of theirs holds as ``cell``."""
    from rackhand.testing.cell import Cell

    given = list(getattr(item, "funcargs", {}).values())
    given = [value[0] if isinstance(value, tuple) and value else value for value in given]
    found = [value if isinstance(value, Cell) else getattr(value, "cell", None) for value in given]
    return list({id(cell): cell for cell in found if isinstance(cell, Cell)}.values())


def _from_ini(config: pytest.Config) -> dict[str, Any]:
    arguments: dict[str, Any] = {}
    if world := config.getini("rackhand_world"):
        folder = (config.inipath.parent if config.inipath else Path()) / world
        arguments["world"] = str(folder) if (folder / "world.yaml").exists() else world
    if seed := config.getini("rackhand_seed"):
        arguments["seed"] = int(seed)
    return arguments
