"""What ``timed_sim`` left."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path


def read_latencies(record: Path, rate: int, turns: Sequence[tuple[float, float]]) -> list[float]:
    """Seconds from state to command (inf: never) of the states that ask for a command and were told in one of the
    ``turns`` [s, perf_counter, which all processes of a machine share]. Raises ``ValueError`` if there is none."""
    notes = json.loads(record.read_text())
    period, answers = 10**9 // rate, dict(notes["answered"])
    asked = [(stamp, at) for stamp, at in notes["told"] if stamp % period == 0]
    latencies = [answers.get(stamp, math.inf) - at for stamp, at in asked if any(a <= at <= b for a, b in turns)]
    if not latencies:
        raise ValueError(f"{record}: {len(notes['told'])} states, none of them in a turn and at {rate} Hz")
    return latencies
