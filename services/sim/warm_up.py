"""Compiles what the simulator calls at every physics step: ``python -m rackhand.services.sim.warm_up`` is a part of
``rackhand prepare``. The service itself compiles it while it builds its world.
"""

from __future__ import annotations

from rackhand.runtime.preparation import prepare
from rackhand.services.sim.simulation import Simulation
from rackhand.worlds.world_model import load_world


def warm_up() -> None:
    """A world with an arm holds its arm while it settles."""
    Simulation(load_world("pick_station"), {}, 0)


if __name__ == "__main__":
    prepare(warm_up)
