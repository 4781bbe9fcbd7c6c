"""A service that stands back does so among sessions, too."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.system.cell import ROOT

AUTOGROUP = Path("/proc/self/autogroup")
ASK = f"""
import os
from pathlib import Path
from services.priority import stand_back

def session() -> str:
    return Path("{AUTOGROUP}").read_text().split(" nice ")[-1].strip()  # empty where a session has no autogroup

before = session()
stand_back(7)
print(os.nice(0), before or "-", session() or "-")
"""

pytestmark = pytest.mark.skipif(not AUTOGROUP.exists(), reason="this kernel has no autogroups")


def niceness(own_session: bool) -> list[str]:
    """Of a process that stands back by 7, and of its session before and after."""
    command = [sys.executable, "-c", ASK]
    return subprocess.run(
        command, cwd=ROOT, start_new_session=own_session, capture_output=True, text=True, check=True
    ).stdout.split()


def test_a_session_of_its_own_stands_back_as_a_whole() -> None:
    assert niceness(own_session=True) == ["7", "0", "7"]


def test_the_others_of_a_session_are_left_alone() -> None:
    process, before, after = niceness(own_session=False)
    assert process == "7"
    assert after == before
