"""The compiled physics step does what MuJoCo and the arms' servos do when called from Python, bit by bit."""

from __future__ import annotations

import math

import pytest

from rackhand.schemas.motion import ArmCommand, FencingToken
from rackhand.services.sim import physics
from rackhand.services.sim.simulation import Simulation
from tests.sim.helpers import make_simulation, make_world

ARMS = {
    "arm1": {"kind": "ur5e", "pose": (0, 3, 0), "mount": 0.6},
    "arm2": {"kind": "fr3", "pose": (0, -3, 0), "mount": 0.6},
}
TOKEN = FencingToken(epoch="e", lease=1)


def run(compiled: bool) -> tuple[Simulation, int]:
    """Both arms stream positions, stop, push with torques and stream again; and how many steps were compiled."""
    simulation = make_simulation(make_world(arms=ARMS))
    count = 0
    if not compiled:
        simulation._physics = None
    elif simulation._physics is not None:
        step = simulation._physics.step

        def counted() -> bool:
            nonlocal count
            count += 1
            return step()

        simulation._physics.step = counted  # type: ignore[method-assign]
    home = {name: simulation.arms[name].measured()[0].copy() for name in simulation.arms}
    for tick in range(150):
        t = tick * 0.004
        for name, start in home.items():
            mode = "torque" if 80 <= tick < 90 else "position"
            values = [0.5] * len(start) if mode == "torque" else (start + 0.1 * math.sin(3 * t)).tolist()
            if not 40 <= tick < 60:  # the stream ends, and begins again
                command = ArmCommand(answers=simulation.stamp, mode=mode, values=tuple(values), token=TOKEN)
                assert simulation.command(name, command)
        simulation.step()
        simulation.step()
    return simulation, count


@pytest.mark.skipif(not physics.is_available(), reason="numba is switched off")
def test_compiled_steps_are_the_same_to_the_bit() -> None:
    plain, none = run(compiled=False)
    fast, count = run(compiled=True)
    assert none == 0 and 0.8 * 600 < count < 600, "torques are not among what is compiled"
    assert fast.digest == plain.digest
