"""Uses everything once that is compiled or imported at its first use, before the arm is ready.

``python -m rackhand.services.controller.warm_up`` is a part of ``rackhand prepare``.
"""

from __future__ import annotations

import json
from concurrent.futures import Executor, Future
from typing import Any

import numpy as np

from rackhand.runtime.preparation import prepare
from rackhand.schemas.motion import ArmState
from rackhand.services.controller import ik
from rackhand.services.controller.controller import Controller
from rackhand.services.controller.motion.disturbance import resting_efforts


class Inline(Executor):
    """Runs every job at once."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def warm_up(arm: ik.Arm, period_ns: int) -> None:
    """Drives an imaginary arm: along a line, around a corner, at a velocity, to a stop."""
    controller = Controller(arm, period_ns, Inline(), lambda: "warm-up")
    here = controller.motion.kinematics.forward(arm.home)
    x, y, z = here.translation.tolist()
    rows = {f"Row{i + 1}": row for i, row in enumerate(here.rotation.tolist())}
    poses = [{"Position": [x, y, z + dz], "Orientation": {"Matrix": rows}} for dz in (-0.01, -0.02)]
    near = (arm.home + 0.01).tolist()
    requests: list[dict[str, Any]] = [
        {"command": "appendPath", "type": "joints", "data": [near, arm.home.tolist()]},
        {"command": "softStop"},
        {"command": "appendPath", "type": "task", "data": poses, "method": 2, "reference": 1},
        {"command": "appendPath", "type": "task", "data": poses[:1], "method": 2, "reference": 1},
        {"command": "hardStop"},
        {"command": "appendPath", "type": "task", "data": poses, "method": 1, "reference": 1},
        {"command": "setVelocity", "type": "joints", "data": [0.01] * arm.n},
        {"command": "setVelocity", "type": "task", "data": [0.01] * 6, "reference": 2},
        {"command": "setParameters", "data": {"Controller": {"ObjectiveFunctions": _objectives()}}},
        {"command": "setVelocity", "type": "task", "data": [0.01] * 6, "reference": 2},
        {"command": "getStatus"},
    ]
    q, stamp = tuple(arm.home.tolist()), 0
    for request in requests:
        controller.request("warm-up", json.dumps({"priority": 1, **request}), None)
        for _ in range(12):
            still = (0.0,) * arm.n
            efforts = tuple(resting_efforts(arm, np.array(q)).tolist())
            state = ArmState(stamp=stamp, q=q, dq=still, efforts=efforts, wrench=(0.0,) * 6)
            command = controller.tick(state, lockstep=True)
            q = command.values if command.mode == "position" else q
            stamp += period_ns


def _objectives() -> dict[str, Any]:
    """All that a client can switch on, with a sphere that the arm is far from."""
    on = {"enable": True, "blend": 0.0}
    sphere = {**on, "center": [0.0, 0.0, 10.0], "radius": 0.1}
    names = ("JointLimits", "DesiredJointPositions", "Manipulability")
    return {**dict.fromkeys(names, on), "CollisionAvoidanceSphere": sphere}


if __name__ == "__main__":
    prepare(lambda: warm_up(ik.load_arm("ur5e"), 4_000_000))
