"""Runs what README, tutorial and other pages show on a cell of its own, on free ports."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from rackhand.testing import Cell

ROOT = Path(__file__).parents[2]
MARK = re.compile(r"^<!-- (?:ci|include): (?P<what>[^;>]+?)(?:; expect: (?P<expect>.+?))? -->$")

RUN_BY = {"sh": ["bash", "-euo", "pipefail", "-c"], "python": [sys.executable, "-c"]}  # other languages only show data


@dataclass(frozen=True)
class Block:
    """A fenced block and the mark on the line before it."""

    language: str
    text: str
    what: str
    expect: str


def blocks(page: Path) -> list[Block]:
    lines = page.read_text(encoding="utf-8").splitlines()
    found, start = [], None
    for number, line in enumerate(lines):
        if start is None and line.startswith("```"):
            start = number
        elif start is not None and line == "```":
            mark = MARK.match(lines[start - 1])
            what, expect = (mark["what"], mark["expect"] or "") if mark else ("", "")
            found.append(Block(lines[start][3:], "\n".join(lines[start + 1 : number]), what, expect))
            start = None
    return found


README = blocks(ROOT / "README.md")
# The other pages' examples, on the cell on which the README's first move has been driven.
PAGES = [block for page in sorted((ROOT / "docs").glob("*.md")) for block in blocks(page)]


def test_every_block_is_marked() -> None:
    assert len(README) >= 2
    for block in README + [block for block in PAGES if block.language in RUN_BY]:
        assert block.what, f"nobody runs this block:\n{block.text}"


def test_blocks_said_to_be_run_elsewhere_are() -> None:
    for block in README + PAGES:
        if block.what.startswith(".ci/"):
            assert block.text in (ROOT / block.what).read_text(encoding="utf-8"), f"{block.what} lacks {block.text}"
        elif block.what not in ("", "run", "start"):
            assert (ROOT / block.what).is_file(), f"there is no {block.what} to run\n{block.text}"


def test_the_tutorial_shows_only_what_is_run() -> None:
    tutorial = [block for block in blocks(ROOT / "docs" / "tutorial.md") if block.language]
    assert len(tutorial) >= 10
    assert {block.what for block in tutorial} == {"start", "run"}


@pytest.mark.system
def test_the_readme_works_as_written(tmp_path: Path) -> None:
    starts = [block for block in README if block.what == "start"]
    assert [block.text for block in starts] == ["make run"]
    with MakeRun(tmp_path) as cell:
        port, bus_port = cell.http.rpartition(":")[2], cell.bus.rpartition(":")[2]
        for block in README + PAGES:
            if block.what == "run":
                text = block.text.replace("8090", port).replace("7447", bus_port)
                shown = run_block(block.language, text, cell.bus)
                assert block.expect in shown, f"{text}\n\nshowed\n\n{shown}\n\nwant {block.expect}"


class MakeRun(Cell):
    """A cell started by ``make run``, with its options in ``ARGS`` as the README says, and stopped by SIGINT."""

    def command(self) -> list[str]:
        return [
            "make",
            "--directory",
            str(ROOT),
            "run",
            "ARGS=" + " ".join(["--port 0 --bus-port 0 --viewer-port 0 --speed max --state-dir", str(self.state_dir)]),
        ]

    def stop(self) -> int:
        if self.supervisor.poll() is None:
            os.killpg(self.supervisor.pid, signal.SIGINT)  # what Ctrl-C in a terminal does
            self.supervisor.wait(30)
        return self.supervisor.returncode


def run_block(language: str, text: str, bus: str) -> str:
    """The output of a block. Fails with it if the exit status is not 0."""
    environment = {**os.environ, "RACKHAND_BUS_CONNECT": bus}
    result = subprocess.run(
        [*RUN_BY[language], text], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert result.returncode == 0, f"{text}\n\n{result.stdout}{result.stderr}"
    return result.stdout
