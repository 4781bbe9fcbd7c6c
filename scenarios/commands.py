"""``rackhand scenario list | check | run``."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from rich.console import Console
from rich.progress import Progress

from rackhand.scenarios.api import Api
from rackhand.scenarios.cell import ScenarioCell
from rackhand.scenarios.results import Results
from rackhand.scenarios.runner import Runner
from rackhand.scenarios.summary import summary
from rackhand.scenarios.sweep import Point, parse_settings, points, run_locally, run_on_dask
from rackhand.scenarios.verdicts import Verdict, table
from rackhand.testing import CellError
from rackhand.worlds.data import WorldFileError
from rackhand.worlds.scenario_check import problems_of
from rackhand.worlds.scenario_model import Scenario, read_scenario, scenario_files
from rackhand.worlds.world_model import load_world

SWEEP = Path("sweep")

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    help="Scenarios: what goes wrong, when, and what must follow, as files `worlds/<world>/scenarios/<name>.yaml`.",
    epilog="\b\nExamples:\n  rackhand scenario list\n  rackhand scenario run rack_missing\n"
    "  rackhand scenario run warehouse --json > verdicts.json\n  rackhand scenario check my_scenario.yaml",
)

Names = Annotated[
    list[str] | None,
    typer.Argument(help="names of scenarios, names of worlds (all of theirs), or files; default: all known ones"),
]
AsJson = Annotated[bool, typer.Option("--json", help="print JSON instead of a table")]


def main() -> None:
    """``rackhand scenario``."""
    app(prog_name="rackhand scenario")


@app.command("list")
def list_scenarios(names: Names = None, as_json: AsJson = False) -> None:
    """List scenarios: the reason that each provokes, and what it shows."""
    scenarios = _load(names)
    if as_json:
        typer.echo(json.dumps([scenario.model_dump(mode="json") for scenario in scenarios], indent=2))
        return
    width = max((len(scenario.name) for scenario in scenarios), default=0)
    for world, group in groupby(scenarios, lambda scenario: scenario.world):
        typer.echo(f"{world}:")
        for scenario in group:
            expect = scenario.expect
            typer.echo(f"  {scenario.name:<{width}}  {int(expect.reason):>4} {expect.reason.rest_name}")
            typer.echo(f"  {'':<{width}}       {scenario.shows}")


@app.command()
def check(names: Names = None) -> None:
    """Check scenario files against their worlds, without running them. Exit status 1 if something is wrong."""
    scenarios = _load(names)
    found = [text for scenario in scenarios for text in problems_of(scenario, load_world(scenario.world))]
    for text in found:
        typer.echo(text, err=True)
    typer.echo(f"{len(scenarios)} scenarios checked, {len(found)} problems")
    raise typer.Exit(1 if found else 0)


@app.command()
def run(
    names: Names = None,
    as_json: AsJson = False,
    seed: Annotated[int | None, typer.Option(min=0, help="seed of all noise; default: that of each scenario")] = None,
) -> None:
    """Run scenarios in cells in lockstep, those of one world one after another in one cell, and judge them.

    Exit status 1 if one does not end as its file expects.
    """
    scenarios = _load(names)
    verdicts: list[Verdict] = []
    try:
        for verdict in run_all(scenarios, seed):
            verdicts.append(verdict)
            mark = "passed" if verdict.passed else "FAILED"
            typer.echo(f"[{len(verdicts)}/{len(scenarios)}] {verdict.scenario} {mark}, {verdict.wall:.1f} s", err=True)
    except (CellError, WorldFileError) as error:
        _fail(str(error))
    typer.echo(json.dumps([verdict.as_json() for verdict in verdicts], indent=2) if as_json else table(verdicts))
    raise typer.Exit(0 if all(verdict.passed for verdict in verdicts) else 1)


@app.command(
    epilog="\b\nExamples:\n  rackhand sweep rack_missing lidar_dead --seeds 100\n"
    "  rackhand sweep rack_slides_on_the_jack --seeds 20 --set planner.control.max_forward_velocity=0.6,1.2"
)
def sweep(
    names: Names = None,
    seeds: Annotated[int, typer.Option(min=1, help="how many seeds: 1 … this")] = 10,
    setting: Annotated[
        list[str] | None,
        typer.Option("--set", help="NAME=VALUE,VALUE…: a setting of the chassis and the values to try"),
    ] = None,
    out: Annotated[Path, typer.Option(help="folder of the results; a sweep that was stopped goes on there")] = SWEEP,
    jobs: Annotated[int | None, typer.Option(min=1, help="cells at a time; default: one for two cores")] = None,
    dask: Annotated[str | None, typer.Option(help="address of a Dask scheduler, as tcp://host:8786")] = None,
) -> None:
    """Run scenarios with many seeds and settings on all cores: a table of results, and a summary with plots.

    Exit status 1 if a run does not end as its scenario expects.
    """
    try:
        values = parse_settings(setting or ())
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    todo = points(_files(names), range(1, seeds + 1), values)
    results = Results(out)
    left = results.left(todo)
    typer.echo(f"{len(todo)} runs, {len(todo) - len(left)} of them done before", err=True)
    try:
        _sweep(results, left, jobs or max(1, (os.cpu_count() or 2) // 2), dask)
    except (CellError, ImportError, OSError) as error:
        _fail(str(error))
    rows = results.rows()
    (out / "summary.html").write_text(summary(rows), encoding="utf-8")
    paths = (results.path, results.write_parquet(), out / "summary.html")
    typer.echo("\n".join(str(path) for path in paths if path is not None))
    raise typer.Exit(0 if all(row.passed for row in rows) else 1)


def _sweep(results: Results, left: Sequence[Point], jobs: int, dask: str | None) -> None:
    if not left:
        return
    verdicts = run_locally(left, min(jobs, len(left))) if dask is None else run_on_dask(left, dask)
    with results, Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("runs", total=len(left))
        for point, verdict in verdicts:
            results.add(point, verdict)
            progress.update(task, advance=1, description=f"{point.scenario}, seed {point.seed}")


def run_all(scenarios: Sequence[Scenario], seed: int | None = None) -> Iterator[Verdict]:
    """Verdicts as they come, world by world. Raises ``CellError`` for a cell that does not start."""
    by_world = sorted(scenarios, key=lambda scenario: scenario.world)
    for world, group in groupby(by_world, lambda scenario: scenario.world):
        yield from _run_in(world, group, seed)


def _run_in(world: str, scenarios: Iterable[Scenario], seed: int | None) -> Iterator[Verdict]:
    with ScenarioCell(world) as cell, Api(cell.http) as api:
        runner = Runner(cell, api)
        for scenario in scenarios:
            yield runner.run(scenario, seed)


def _load(names: Sequence[str] | None) -> tuple[Scenario, ...]:
    return tuple(scenario for _, scenario in _files(names))


def _files(names: Sequence[str] | None) -> list[tuple[Path, Scenario]]:
    try:
        return [(path.absolute(), read_scenario(path)) for path in scenario_files(names or ())]
    except WorldFileError as error:
        _fail(str(error))


def _fail(text: str) -> NoReturn:
    typer.echo(f"scenario: {text}", err=True)
    raise typer.Exit(2)
