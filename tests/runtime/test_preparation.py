"""How far compilation has come, as it is reported by a process that compiles."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

CODE = """
import queue
from rackhand.runtime.compiled import compiled
from rackhand.runtime.preparation import prepare, progress

@compiled
def first(x):
    return x + 1

@compiled
def second(x):
    return first(x) + 1

@compiled
def unused(x):
    return x
"""
PREPARE = CODE + "prepare(lambda: second(1))"
REPORT = (
    CODE
    + """
seen = queue.Queue()
with progress(lambda *counts: seen.put(counts), every=0.02):
    first(1)
    print(seen.get(timeout=60))
    second(1)
    print(seen.get(timeout=60))
"""
)


def run(folder: Path, code: str) -> str:
    (folder / "mine.py").write_text(code)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache")}
    said = subprocess.run([sys.executable, "mine.py"], cwd=folder, env=environment, capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    return said.stdout


def test_prepare_begins_with_none_and_ends_with_all(tmp_path: Path) -> None:
    lines = run(tmp_path, PREPARE).splitlines()
    assert lines[0] == "0 3"
    assert lines[-1] == "3 3"


def test_progress_is_reported_when_there_is_some(tmp_path: Path) -> None:
    assert run(tmp_path, REPORT) == "(1, 3)\n(2, 3)\n"
