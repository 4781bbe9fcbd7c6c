"""Every scenario that comes with rackhand, run over HTTP: each reason why a move fails, and that the next job works.

Scenarios of one world run in one cell, one after another, each from a new run of the world.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import groupby

import pytest

from rackhand.scenarios.api import Api
from rackhand.scenarios.cell import ScenarioCell
from rackhand.scenarios.runner import Runner
from rackhand.worlds.scenario_model import Scenario, load_scenarios

# By world, so that each cell is started once.
SCENARIOS = sorted(load_scenarios(()), key=lambda scenario: (scenario.world, scenario.name))
RunnerOf = Callable[[str], Runner]


@pytest.fixture(scope="module")
def runner_of() -> Iterator[RunnerOf]:
    """World → the runner in its cell; one cell at a time."""
    with ExitStack() as cell:
        running: dict[str, Runner] = {}

        def runner(world: str) -> Runner:
            if world not in running:
                cell.close()
                running.clear()
                stage = cell.enter_context(ScenarioCell(world))
                running[world] = Runner(stage, cell.enter_context(Api(stage.http)))
            return running[world]

        yield runner


@pytest.mark.parametrize(
    "scenario",
    [pytest.param(one, id=one.name, marks=[pytest.mark.slow] if one.slow else []) for one in SCENARIOS],
)
def test_a_scenario_ends_as_its_file_expects(scenario: Scenario, runner_of: RunnerOf) -> None:
    verdict = runner_of(scenario.world).run(scenario)
    assert verdict.problems == ()


def test_the_order_starts_each_cell_once() -> None:
    worlds = [world for world, _ in groupby(SCENARIOS, lambda scenario: scenario.world)]
    assert len(worlds) == len(set(worlds)) > 1
