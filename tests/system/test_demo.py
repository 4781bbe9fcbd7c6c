"""The demonstration in lockstep: its clients read only public APIs, the judge alone knows what happened."""

from __future__ import annotations

from pathlib import Path

from benchmarks.demo import played_with
from rackhand.services.launch.demo.story import STORY


def test_the_story_is_played_to_its_end(tmp_path: Path) -> None:
    played = played_with(3, tmp_path)
    assert played.problems == []
    assert [line for line in played.printed.splitlines() if line.startswith(f"{len(STORY):>2}/{len(STORY)}")]
    assert all(step.title in played.printed for step in STORY)
