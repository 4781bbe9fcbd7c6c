"""What is compiled is what the files say, also where a change is in another file than the compiled function."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

INNER = "from rackhand.runtime.compiled import compiled\n\n@compiled\ndef inner(x):\n    return x + {step}\n"
OUTER = (
    "from inner import inner\nfrom rackhand.runtime.compiled import compiled\n\n"
    "@compiled\ndef outer(x):\n    return inner(x)\n"
)
ASK = "import outer; print(outer.outer(1)); print(sum(outer.outer.stats.cache_hits.values()))"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "outer.py").write_text(OUTER)
    return tmp_path


def ask(folder: Path, step: int) -> tuple[int, int]:
    """What another process computes, and how much of its machine code it found on disk."""
    (folder / "inner.py").write_text(INNER.format(step=step))
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    said = subprocess.run([sys.executable, "-c", ASK], env=environment, capture_output=True, text=True, check=True)
    value, hits = said.stdout.split()
    return int(value), int(hits)


def test_code_is_kept_until_a_module_it_imports_changes(folder: Path) -> None:
    assert ask(folder, step=1) == (2, 0)
    assert ask(folder, step=1) == (2, 1)
    assert ask(folder, step=10) == (11, 0), "outer.py did not change, what it calls did"
    assert ask(folder, step=10) == (11, 1)
