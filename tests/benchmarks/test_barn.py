"""BARN: the organisers' formula, what a run lost its score by, and which worlds are driven."""

from __future__ import annotations

import json
import xml.etree.ElementTree
from dataclasses import replace

import pytest

from benchmarks.barn import DATA, drive_in_process, report, spread
from benchmarks.barn.plot import plot
from benchmarks.barn.score import Result, cause, speed_kinds

RUN = Result("7", "succeeded", 10.0, 5.0, 0.4, 0, (0.0, 0.5, 2.5, 7.0))


@pytest.mark.parametrize(
    ("time", "score"), [(4.0, 0.5), (10.0, 0.5), (12.5, 0.4), (20.0, 0.25), (40.0, 0.125), (90.0, 0.125)]
)
def test_the_score_is_the_share_of_the_optimal_time_clipped(time: float, score: float) -> None:
    assert replace(RUN, time=time).score == pytest.approx(score)


def test_who_does_not_arrive_or_touches_something_has_none() -> None:
    assert replace(RUN, state="failed").score == replace(RUN, contacts=1).score == 0.0
    assert cause(replace(RUN, state="failed")) == "not arrived" and cause(replace(RUN, contacts=1)) == "contact"


def test_a_slow_run_lost_its_score_by_what_it_did_most() -> None:
    assert cause(RUN) == ""
    slow = replace(RUN, time=14.0)
    assert cause(slow) == "long way"
    assert cause(replace(slow, seconds=(8.0, 1.0, 2.0, 3.0))) == "stands"
    assert cause(replace(slow, seconds=(1.0, 8.0, 2.0, 3.0))) == "creeps"


def test_seconds_at_each_speed() -> None:
    path = [(0.0, 0.0), (0.0, 0.0), (0.02, 0.0), (0.07, 0.0), (0.27, 0.0), (0.27, 0.15)]
    assert speed_kinds(path, 0.1) == (0.1, 0.1, 0.1, 0.2)


def test_a_result_is_read_as_it_was_written() -> None:
    assert Result.of(json.loads(json.dumps(RUN.record()))) == RUN


def test_worlds_are_spread_evenly() -> None:
    numbers = sorted(json.loads(DATA.read_text())["worlds"], key=int)
    assert len(numbers) == 250 and spread(numbers, 0) == numbers == spread(numbers, 250)
    assert spread(numbers, 3) == [numbers[0], numbers[83], numbers[166]]


def test_report_and_plot_tell_what_was_lost() -> None:
    results = [RUN, replace(RUN, world="8", time=20.0), replace(RUN, world="9", state="failed", why="no path")]
    text = report(results).markdown()
    assert "| rackhand | 0.2500 | 66.7 % | 0 |" in text
    assert "| not arrived | 1 | 0.1667 |" in text and "| 9 | failed | 0.000 |" in text
    bars = [e for e in xml.etree.ElementTree.fromstring(plot(results)).iter() if e.tag.endswith("title")]
    assert [bar.text.split(":")[0] for bar in bars if bar.text] == ["world 9", "world 8", "world 7"]


def test_a_world_is_driven_in_one_process() -> None:
    run = drive_in_process(DATA, "1")
    assert run.succeeded and run.off < 1.0 and sum(run.seconds) == pytest.approx(run.time, abs=0.2)
