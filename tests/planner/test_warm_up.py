"""After ``warm_up`` nothing is compiled any more: a tick that waits for a compiler is a tick without a command."""

from __future__ import annotations

import subprocess
import sys

# A process of its own: in this one other tests have compiled things already.
SCRIPT = """
import importlib, pkgutil
import numpy as np
from numba.core.dispatcher import Dispatcher
import rackhand.services.planner as planner
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.settings import NavigationSettings
from rackhand.services.planner.warm_up import warm_up
from tests.planner.plant import Hall, Plant, Robot, Walker, box, run

def compiled():
    found = pkgutil.walk_packages(planner.__path__, planner.__name__ + ".")
    names = [m.name for m in found if "__main__" not in m.name]
    modules = [importlib.import_module(name) for name in names]
    found = {id(f): f for m in modules for f in vars(m).values() if isinstance(f, Dispatcher)}
    return {(f.py_func.__qualname__, s) for f in found.values() for s in f.signatures}

warm_up(NavigationSettings())
before = compiled()
hall = Hall(12, 6, [box(6.0, 3.0, 0.5, 3.4)])
plant = Plant(hall, (1.5, 1.5, 0.0), seed=1)
plant.crates = (box(3.5, 1.4, 0.4, 0.4),)
plant.walkers = (Walker(np.array([(10.0, 1.2), (4.0, 1.2)]), 1.0, polite=True),)
run(Robot(plant), plant, Goal(10.5, 4.5, 1.5), 90)
late = sorted(name for name, _ in compiled() - before)
assert len(before) > 10, before
print("late:", late)
"""


def test_nothing_is_compiled_after_warm_up() -> None:
    result = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=240, check=False)
    assert result.stdout.strip() == "late: []", result.stdout + result.stderr[-2000:]
