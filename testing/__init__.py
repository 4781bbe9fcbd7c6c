"""Test kit: run your own tests against a whole cell, with ground truth, faults and a clock that you control.

    from rackhand.testing import Cell

    with Cell(world="warehouse", seed=7) as cell:
        run_my_client(cell.http)
        assert cell.true_pose("amr1").x > 5.0

* ``Cell``: all services as processes, on free ports, with a state folder of its own, in lockstep.
* ``Judge``: ground truth, and control of the world: obstacles, faults, time. A cell has one.
* ``Chassis``, ``Arm``: small clients, for what a test must do besides running the client under test.

Units are SI, poses are in the map frame. ``rackhand.testing.plugin`` is the pytest plugin with the fixtures ``cell``,
``world``, ``chassis`` and ``arm``; install it with ``pip install rackhand[testing]``.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rackhand.services.launch.background import CellError
    from rackhand.testing.arm import Arm
    from rackhand.testing.cell import Cell, without_arms
    from rackhand.testing.chassis import Chassis
    from rackhand.testing.judge import Judge
    from rackhand.testing.poses import distance, planar, turn

__all__ = ["Arm", "Cell", "CellError", "Chassis", "Judge", "distance", "planar", "turn", "without_arms"]

# Looked up at first use: pytest imports this package in every run of every project, for the plugin in it.
_WHERE = {
    "Arm": "rackhand.testing.arm",
    "Cell": "rackhand.testing.cell",
    "CellError": "rackhand.services.launch.background",
    "Chassis": "rackhand.testing.chassis",
    "Judge": "rackhand.testing.judge",
    "distance": "rackhand.testing.poses",
    "planar": "rackhand.testing.poses",
    "turn": "rackhand.testing.poses",
    "without_arms": "rackhand.testing.cell",
}


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_WHERE[name]), name)
