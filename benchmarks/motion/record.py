"""What ``timed_sim`` left."""

from __future__ import annotations

import json
import math
from pathlib import Path


def read_latencies(record: Path, rate: int, seconds: float) -> list[float]:
    """Seconds from state to command (inf: never) over the last ``seconds`` but one of those that ask for a command."""
    notes = json.loads(record.read_text())
    period, answers = 10**9 // rate, dict(notes["answered"])
    asked = [(stamp, at) for stamp, at in notes["told"] if stamp % period == 0]
    end = max(at for _, at in asked) - 1.0
    return [answers.get(stamp, math.inf) - at for stamp, at in asked if end - seconds <= at <= end]
