"""Random valid commands, also into each other: limits hold, everything is answered, all ends at rest."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rackhand.services.controller import ik
from tests.controller.cell import FR3, UR5E, PerfectArm, moved, pose

SEEDS = st.integers(0, 2**32 - 1)
KINDS = (
    "joints", "task", "tcp", "by joints", "velocity", "task velocity", "torque", "softStop", "hardStop", "profile",
    "acceleration", "objectives", "sphere", "resumeControl", "lockControl", "getStatus",
)  # fmt: skip
COMMANDS = st.lists(st.tuples(st.sampled_from(KINDS), SEEDS, st.integers(0, 100)), min_size=1, max_size=30)


def request(kind: str, seed: int, cell: PerfectArm) -> dict[str, Any]:
    """A request that a client could mean, near where the arm is."""
    random, arm = np.random.default_rng(seed), cell.arm
    n, limits = arm.n, arm.limits
    near = [np.clip(cell.q + random.uniform(-0.7, 0.7, n), limits.lower, limits.upper).tolist() for _ in range(3)]
    here = cell.tool()
    poses = [pose(moved(here, *random.uniform(-0.12, 0.12, 3))) for _ in range(random.integers(1, 4))]
    step = pose(np.column_stack([np.eye(3), random.uniform(-0.05, 0.05, 3)]))
    share = float(random.uniform(0.05, 1.0))
    twist = (random.uniform(-1, 1, 6) * np.repeat([limits.task_velocity], 3)).tolist()
    functions = {
        "JointLimits": {"enable": bool(random.random() < 0.5), "blend": 0.1},
        "Manipulability": {"enable": bool(random.random() < 0.5)},
    }
    sphere = {"enable": True, "center": (here[:, 3] + random.uniform(0.2, 0.4, 3)).tolist(), "radius": 0.1}
    requests: dict[str, dict[str, Any]] = {
        "joints": {"command": "appendPath", "type": "joints", "data": near},
        "task": {"command": "appendPath", "type": "task", "data": poses, "method": 2, "reference": 1},
        "tcp": {"command": "appendPath", "type": "task", "data": [step], "method": 2, "reference": 2},
        "by joints": {"command": "appendPath", "type": "task", "data": poses, "method": 1, "reference": 1},
        "velocity": {
            "command": "setVelocity",
            "type": "joints",
            "data": (random.uniform(-1, 1, n) * limits.velocity).tolist(),
        },
        "task velocity": {"command": "setVelocity", "type": "task", "data": twist, "reference": 1 + seed % 2},
        "torque": {"command": "setTorque", "type": "joints", "data": random.uniform(-1, 1, n).tolist()},
        "profile": {"command": "setProfileVelocity", "type": "joints", "data": (share * limits.velocity).tolist()},
        "acceleration": {
            "command": "setProfileAcceleration",
            "type": "joints",
            "data": (share * limits.acceleration).tolist(),
        },
        "objectives": {"command": "setParameters", "data": {"Controller": {"ObjectiveFunctions": functions}}},
        "sphere": {
            "command": "setParameters",
            "data": {"Controller": {"ObjectiveFunctions": {"CollisionAvoidanceSphere": sphere}}},
        },
    }
    return {"priority": 10, **requests.get(kind, {"command": kind})}


@pytest.mark.parametrize("arm", [UR5E, FR3], ids=["ur5e", "fr3"])
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(commands=COMMANDS)
def test_whatever_is_commanded_limits_hold_and_it_ends_at_rest(
    arm: ik.Arm, commands: list[tuple[str, int, int]]
) -> None:
    cell = PerfectArm(arm)
    tickets, torques = [], False
    for kind, seed, ticks in commands:
        torques |= kind == "torque"
        tickets.append(cell.send("a", json.dumps(request(kind, seed, cell))))
        cell.advance(0.004 * ticks)
        cell.controller.poll()
    cell.ask("a", command="softStop", priority=10)
    cell.until_rest(20.0)
    where = cell.q.copy()
    cell.advance(0.2)
    assert np.abs(cell.q - where).max() < 1e-9, "nothing moves by itself"
    assert cell.errors == []
    assert all(ticket in cell.answers for ticket in tickets)
    if torques:
        q, _ = cell.driven()
        assert (q >= arm.limits.lower - 1e-9).all() and (q <= arm.limits.upper + 1e-9).all()
    else:
        cell.check_limits()
