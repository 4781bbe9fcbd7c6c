"""The test kit as its users have it: a client's tests in a folder of their own, and the methods of a cell."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rackhand.testing import Cell
from rackhand.testing.world import NotWithin
from tests.system.cell import ROOT

CLIENT = ROOT / "examples" / "client_tests"


def run_client_tests(folder: Path) -> subprocess.CompletedProcess[str]:
    """As in a client's own repository, with the plugin loaded by name where rackhand is not installed as a package."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "rackhand.testing.plugin", "-p", "no:cacheprovider"]
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
    environment["COLUMNS"] = "200"  # a narrow summary leaves the reasons out
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_a_clients_tests_pass_and_fail_for_the_reason_that_they_should(tmp_path: Path) -> None:
    shutil.copytree(CLIENT, tmp_path / "client")
    wrong = (tmp_path / "client" / "mover.py").read_text().replace("{16, 1000}", "set()")
    (tmp_path / "client" / "mover.py").write_text(wrong)
    result = run_client_tests(tmp_path / "client")
    assert "1 failed, 2 passed" in result.stdout, result.stdout + result.stderr
    assert re.search(r"FAILED test_mover.py::test_it_tries_again.*NotReached", result.stdout), result.stdout
    assert "log of the cell" in result.stdout


def test_time_passes_in_advance_only(cell: Cell) -> None:
    cell.pause()
    before = cell.now()
    assert cell.now() == before
    cell.advance(0.5)
    assert cell.now() == pytest.approx(before + 0.5)
    with pytest.raises(NotWithin, match="pigs fly"):
        cell.until(lambda: None, "pigs fly", within=0.3)
    assert before + 0.8 <= cell.now() <= before + 1.0
