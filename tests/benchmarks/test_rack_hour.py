"""What an hour of rack jobs writes down is what it goes on from."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from benchmarks.rack_hour import Tally, read, together, write


def tally(jobs: int) -> Tally:
    return Tally(
        seconds=1200.0,
        jobs=jobs,
        given_up=["at s1"],
        ends=Counter({"succeeded": 3, "failed 1000": 1}),
        interruptions=Counter(cancel=2),
        misplaced={"s1": "s1 is free, the API says occupied"},
    )


def test_results_are_read_as_they_were_written(tmp_path: Path) -> None:
    file = tmp_path / "results.jsonl"
    assert read(file) == {}
    write(file, "people", 0, tally(7))
    write(file, "people", 1, tally(8))
    assert read(file) == {("people", 0): tally(7), ("people", 1): tally(8)}


def test_worlds_are_added_up() -> None:
    whole = together([tally(7), tally(8)])
    assert (whole.seconds, whole.jobs, whole.given_up) == (2400.0, 15, ["at s1", "at s1"])
    assert whole.ends == Counter({"succeeded": 6, "failed 1000": 2}) and whole.interruptions == Counter(cancel=4)
    assert len(whole.misplaced) == 2, "one of each world"
