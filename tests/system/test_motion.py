"""The arm of the pick station through the whole cell: requests over Zenoh, physics underneath.

In lockstep and simulation time: what is measured does not depend on the machine.
"""

from __future__ import annotations

import json

import numpy as np

from rackhand.testing import Cell
from tests.joined.checks import ARM, first_rest, speeds
from tests.system.station import CONTROLLER, Station


def test_a_locked_arm_drives_a_joint_path(station: Station) -> None:
    assert station.ask("a", command="lockControl", priority=10, id=1)["message"] is True
    goal = ARM.home + 0.3
    station.ok(command="appendPath", type="joints", data=[(ARM.home + 0.1).tolist(), goal.tolist()])
    states = station.advance(3.0)
    assert np.abs(np.array(states[-1].q) - goal).max() < 1e-4
    assert speeds(states)[-1] < 1e-3
    assert station.status()["isTrajectoryRunning"]["value"] is False
    assert station.status()["priorityUnderControl"] == 10


def test_a_killed_controller_leaves_the_joints_at_rest(station: Station) -> None:
    """It comes back with no holder and an empty queue."""
    far = ARM.home + np.eye(ARM.n)[0] * 1.5
    station.ok(command="appendPath", type="joints", data=[far.tolist()])
    moving = station.advance(0.5)
    assert speeds(moving)[-1] > 0.5
    epoch = station.status()["epoch"]
    former = station.cell.kill(controller_row(station.cell))
    station.cell.wait_for(lambda: CONTROLLER not in station.judge.inspect().participants or None, "it is missed")
    states = station.advance(1.0)
    print(f"at rest {first_rest(states, moving[-1].stamp):.0f} ms after the last command")
    assert first_rest(states, moving[-1].stamp) < 600
    assert np.abs(np.array(states[-1].q) - far).max() > 0.1, "far from where it was going"
    station.cell.wait_until_restarted(controller_row(station.cell), former)
    station.cell.wait_for(station.status_or_none, "it answers")
    station.settle()
    status = station.status()
    assert status["epoch"] != epoch
    assert status["priorityUnderControl"] == 0
    assert status["isTrajectoryRunning"]["value"] is False
    after = station.advance(0.5)
    assert np.abs(np.array(after[-1].q) - np.array(states[-1].q)).max() < 1e-4, "nothing goes on"
    station.ok(command="appendPath", type="joints", data=[ARM.home.tolist()])
    assert np.abs(np.array(station.advance(4.0)[-1].q) - ARM.home).max() < 1e-4


def controller_row(cell: Cell) -> str:
    """What the supervisor calls the arm's controller."""
    facts = json.loads((cell.state_dir / "cell.json").read_text())
    return next(str(name) for name in facts["pids"] if "controller" in name)
