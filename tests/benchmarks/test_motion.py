"""What the benchmark of the motion loop counts."""

import json
import math
from pathlib import Path

from benchmarks.motion.record import read_latencies


def test_only_states_that_ask_for_a_command_count_and_silence_is_never(tmp_path: Path) -> None:
    """States each 2 ms, commands at 250 Hz: those of 0 and 4 ms are answered after 1 ms, that of 8 ms is not; the last
    was told out of turn."""
    record = tmp_path / "latencies.json"
    told = [[2_000_000 * i, 10.0 + 0.002 * i] for i in range(5)] + [[20_000_000, 11.008]]
    record.write_text(json.dumps({"told": told, "answered": [[0, 10.001], [4_000_000, 10.005], [2_000_000, 10.9]]}))
    latencies = read_latencies(record, 250, [(9.9, 10.5), (10.6, 11.0)])
    assert [round(latency, 9) for latency in latencies] == [0.001, 0.001, math.inf]
