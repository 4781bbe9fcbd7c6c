"""Sweeps: which runs they are, the table that they go on from, and the summary of it."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from rackhand.scenarios.results import Results
from rackhand.scenarios.summary import histogram, percentile, summary
from rackhand.scenarios.sweep import Point, parse_settings, points, run_on_dask, run_point
from rackhand.scenarios.verdicts import Verdict
from rackhand.worlds.scenario_model import known_scenarios, read_scenario

FILES = [known_scenarios()[name] for name in ("rack_missing", "lidar_dead")]
SCENARIOS = [(path, read_scenario(path)) for path in FILES]


def verdict(point: Point, took: float | None = 6.0, problems: tuple[str, ...] = ()) -> Verdict:
    message = "3 of 4 legs, “all” of them\n"
    return Verdict(point.scenario, point.world, point.seed, "failed", 501, message, took, 0, 9.0, 1.0, problems)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("planner.control.max_forward_velocity=0.6,1.2", {"control.max_forward_velocity": (0.6, 1.2)}),
        ("a=true", {"a": (True,)}),
        ("mode=slow,fast", {"mode": ("slow", "fast")}),
        ('rack.specs=[{"width": 0.7, "depth": 0.7}]', {"rack.specs": ([{"width": 0.7, "depth": 0.7}],)}),
    ],
)
def test_settings_are_read(text: str, found: dict[str, Any]) -> None:
    assert parse_settings([text]) == found


@pytest.mark.parametrize("text", ["a", "=1", "a=", "planner.=2"])
def test_what_is_no_setting_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="want NAME=VALUE"):
        parse_settings([text])


def test_every_combination_is_a_run_and_those_of_a_world_are_together() -> None:
    found = points(SCENARIOS, range(1, 4), {"a": (1, 2), "b": ("x",)})
    assert len(found) == 2 * 3 * 2 and len({point.key for point in found}) == len(found)
    assert [point.world for point in found] == sorted(point.world for point in found)
    assert found[0].key == ("lidar_dead", "1", 'a=1 b="x"')


def test_a_sweep_goes_on_with_what_has_no_row(tmp_path: Path) -> None:
    todo = points(SCENARIOS, range(1, 3), {"a": (1, 2)})
    results = Results(tmp_path)
    assert results.left(todo) == todo
    with results:
        results.add(todo[0], verdict(todo[0]))
        results.add(todo[5], verdict(todo[5], None, ("it is still moving", "again")))
    with results:
        results.add(todo[2], verdict(todo[2]))
    assert Results(tmp_path).left(todo) == [point for k, point in enumerate(todo) if k not in (0, 2, 5)]
    rows = results.rows()
    assert [(row.took, row.passed) for row in rows] == [(6.0, True), (None, False), (6.0, True)]
    assert rows[1].problems == "it is still moving; again"


def test_a_row_that_was_cut_off_is_done_again(tmp_path: Path) -> None:
    (point,) = points(SCENARIOS[:1], [1], {})
    results = Results(tmp_path)
    with results:
        results.add(point, verdict(point))
    whole = results.path.read_bytes()
    results.path.write_bytes(whole[: whole.rindex(b"failed,501") + 4])
    assert results.left([point]) == [point]
    with results:
        results.add(point, verdict(point))
    assert results.left([point]) == [] and [row.took for row in results.rows()] == [6.0]


def test_the_summary_counts_and_shows_what_did_not_pass(tmp_path: Path) -> None:
    todo = points(SCENARIOS[:1], range(1, 11), {})
    results = Results(tmp_path)
    with results:
        for point in todo:
            late = point.seed == 4
            results.add(point, verdict(point, 5.0 + point.seed, ("ended after <9> s",) if late else ()))
    page = summary(results.rows())
    assert "10 runs, 9 passed, 1 not" in page and '<span class="bad">9 of 10</span>' in page
    assert "10.5, 15.0" in page and "ended after &lt;9&gt; s" in page
    assert "rack_detection_error 10" in page


def test_a_histogram_has_a_bar_for_each_part_that_holds_something() -> None:
    svg = ElementTree.fromstring(histogram([0.1, 0.2, 9.9, 10.0], 10.0))
    heights = [float(bar.attrib["height"]) for bar in svg.iter("rect")]
    assert heights == pytest.approx([84.0, 84.0])


@pytest.mark.parametrize(("share", "value"), [(0.5, 5), (0.95, 10), (0.9, 9), (0.0, 1), (1.0, 10)])
def test_percentiles(share: float, value: float) -> None:
    assert percentile(list(range(1, 11)), share) == value


def test_a_point_is_run_with_its_seed_and_settings() -> None:
    class Played:
        def run(self, scenario: Any, seed: int, settings: dict[str, Any]) -> Any:
            return scenario.name, seed, settings

    (point,) = points(SCENARIOS[:1], [7], {"a": (1,)})
    assert run_point(point, lambda _: Played()) == ("rack_missing", 7, {"a": 1})  # type: ignore[arg-type,return-value]


@pytest.mark.skipif(find_spec("pyarrow") is None, reason="pyarrow is not installed")
def test_parquet_has_the_same_rows(tmp_path: Path) -> None:
    from pyarrow import parquet

    (point,) = points(SCENARIOS[:1], [1], {})
    results = Results(tmp_path)
    with results:
        results.add(point, verdict(point))
    path = results.write_parquet()
    assert path is not None and parquet.read_table(path).num_rows == 1


@pytest.mark.system
@pytest.mark.skipif(find_spec("distributed") is None, reason="distributed is not installed")
def test_runs_on_a_local_dask_cluster_of_two_workers() -> None:
    from distributed import LocalCluster

    todo = points(
        [(known_scenarios()["goal_beside_the_map"], read_scenario(known_scenarios()["goal_beside_the_map"]))],
        range(1, 5),
        {},
    )
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        found = dict(run_on_dask(todo, cluster.scheduler_address))
    assert set(found) == set(todo)
    assert all(verdict.passed for verdict in found.values()), found
