"""What the benchmark of the motion loop counts."""

import json
import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.motion.arm import PerfectArm
from benchmarks.motion.driver import STILL
from benchmarks.motion.record import read_latencies
from benchmarks.motion.timed_sim import TimedSim
from rackhand.services.controller.ik import load_arm
from rackhand.services.sim.service import SimService


def test_only_states_that_ask_for_a_command_count_and_silence_is_never(tmp_path: Path) -> None:
    """States each 2 ms, commands at 250 Hz: those of 0 and 4 ms are answered after 1 ms, that of 8 ms is not; the last
    was told out of turn."""
    record = tmp_path / "latencies.json"
    told = [[2_000_000 * i, 10.0 + 0.002 * i] for i in range(5)] + [[20_000_000, 11.008]]
    record.write_text(json.dumps({"told": told, "answered": [[0, 10.001], [4_000_000, 10.005], [2_000_000, 10.9]]}))
    latencies = read_latencies(record, 250, [(9.9, 10.5), (10.6, 11.0)])
    assert [round(latency, 9) for latency in latencies] == [0.001, 0.001, math.inf]


def test_the_perfect_arm_is_at_rest_where_it_was_sent_and_its_motors_gave_the_momentum() -> None:
    """The motors' torques, less weight and damping, are what has changed the joints' momentum."""
    kind = load_arm("ur5e")
    arm, period = PerfectArm(kind, 0.002), 0.002
    goal, data = kind.home + 0.1, kind.model.createData()
    for i in range(300):
        before = (arm.q, arm.dq)
        if i % 2 == 0:
            arm.go_to(kind.home + (goal - kind.home) * min(1.0, i / 100), arm.time)
        arm.advance()
        middle, acceleration = 0.5 * (arm.dq + before[1]), (arm.dq - before[1]) / period
        needed = pin.rnea(kind.model, data, 0.5 * (arm.q + before[0]), middle, acceleration)
        assert np.allclose(arm.efforts, needed + kind.model.damping * middle, atol=0.05), i
    assert np.allclose(arm.q, goal, atol=1e-6) and np.abs(arm.dq).max() < STILL
    assert np.allclose(arm.efforts, pin.computeGeneralizedGravity(kind.model, data, goal), atol=1e-3)


def test_a_record_without_states_is_an_error(tmp_path: Path) -> None:
    record = tmp_path / "latencies.json"
    record.write_text(json.dumps({"told": [[0, 1.0]], "answered": []}))
    with pytest.raises(ValueError, match="1 states, none of them in a turn"):
        read_latencies(record, 250, [(2.0, 3.0)])


def test_the_timed_simulator_hooks_what_the_simulator_has() -> None:
    """It notes what passes methods of the service, which may be renamed."""
    hooks = {name for name, value in vars(TimedSim).items() if callable(value)}
    assert hooks and hooks <= set(dir(SimService))
