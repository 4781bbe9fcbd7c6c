"""Sweeps: scenarios × seeds × settings, each combination one run, on all cores or on a Dask cluster, resumable."""

from __future__ import annotations

import atexit
import itertools
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from rackhand.scenarios.api import Api
from rackhand.scenarios.cell import ScenarioCell
from rackhand.scenarios.runner import Runner
from rackhand.scenarios.verdicts import Verdict
from rackhand.worlds.scenario_model import Scenario, read_scenario

Settings = tuple[tuple[str, Any], ...]


@dataclass(frozen=True)
class Point:
    """One run: the file of a scenario, a seed, and settings of the chassis by their names in ``/system/settings``."""

    file: str
    scenario: str
    world: str
    seed: int
    settings: Settings = ()

    @property
    def key(self) -> tuple[str, str, str]:
        """What tells it from the others of a sweep, as the table has it."""
        return self.scenario, str(self.seed), settings_text(self.settings)


def settings_text(settings: Settings) -> str:
    """As ``control.max_forward_velocity=0.6``, several separated by spaces."""
    return " ".join(f"{name}={json.dumps(value)}" for name, value in settings)


def parse_settings(given: Iterable[str]) -> dict[str, tuple[Any, ...]]:
    """Setting → its values, of texts as ``planner.control.max_forward_velocity=0.6,1.2``; ``planner.`` may be left out.

    Values are JSON, or else texts. Raises ``ValueError``.
    """
    found: dict[str, tuple[Any, ...]] = {}
    for text in given:
        name, equals, values = text.removeprefix("planner.").partition("=")
        if not name or not equals or not values:
            raise ValueError(f"{text!r}: want NAME=VALUE or NAME=VALUE,VALUE")
        found[name] = _values(values)
    return found


def _values(text: str) -> tuple[Any, ...]:
    """A JSON list or object is one value; else commas separate them."""
    return tuple(_value(part) for part in ([text] if text[0] in "[{" else text.split(",")))


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def points(
    scenarios: Sequence[tuple[Path, Scenario]], seeds: Sequence[int], settings: dict[str, tuple[Any, ...]]
) -> list[Point]:
    """Every combination; those of one world together, so that a worker keeps its cell."""
    combinations = [tuple(zip(settings, values, strict=True)) for values in itertools.product(*settings.values())]
    found = [
        Point(str(path), scenario.name, scenario.world, seed, combination)
        for path, scenario in scenarios
        for combination in combinations
        for seed in seeds
    ]
    return sorted(found, key=lambda point: point.world)


def run_locally(todo: Sequence[Point], jobs: int) -> Iterator[tuple[Point, Verdict]]:
    """Results as they come. Each of the ``jobs`` processes has a cell of its own."""
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from _collect({pool.submit(run_point, point): point for point in todo})


def run_on_dask(todo: Sequence[Point], address: str) -> Iterator[tuple[Point, Verdict]]:
    """The same on the workers of a Dask cluster, which have rackhand and the scenario files. Needs ``distributed``."""
    from distributed import Client
    from distributed import as_completed as completed

    with Client(address) as client:
        submitted = {client.submit(run_point, point, pure=False): point for point in todo}
        for future in completed(list(submitted)):
            yield submitted[future], future.result()


def _collect(submitted: dict[Future[Verdict], Point]) -> Iterator[tuple[Point, Verdict]]:
    for future in as_completed(submitted):
        yield submitted[future], future.result()


# -- in a worker process ---------------------------------------------------------------------------------------------


class _Stage:
    """The cell of this process: kept until a scenario of another world comes, or the process ends."""

    def __init__(self) -> None:
        self._open, self._world = ExitStack(), ""
        self._runner: Runner | None = None
        atexit.register(self.close)

    def runner(self, world: str) -> Runner:
        if self._runner is None or self._world != world:
            self.close()
            cell = self._open.enter_context(ScenarioCell(world))
            self._runner, self._world = Runner(cell, self._open.enter_context(Api(cell.http))), world
        return self._runner

    def close(self) -> None:
        self._open.close()
        self._runner = None


_stage: _Stage | None = None


def run_point(point: Point, runner_of: Callable[[str], Runner] | None = None) -> Verdict:
    """Run one point in the cell of this process."""
    global _stage
    if runner_of is None:
        _stage = _stage or _Stage()
        runner_of = _stage.runner
    return runner_of(point.world).run(read_scenario(Path(point.file)), point.seed, dict(point.settings))
