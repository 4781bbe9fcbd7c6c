"""How fast the whole cell runs while a move is driven: free and in lockstep, beside the bare physics of one run."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import mujoco

from benchmarks.report import Report
from tests.system.cell import Cell
from tests.system.driving import Driver
from tests.system.judge import Judge, standard

SECONDS = 30.0  # of simulation time, each
GOALS = ((9.0, 7.3), (2.5, 7.3))


def run() -> Report:
    bare = bare_physics()
    free = whole_cell("--speed", "max")
    lockstep = whole_cell("--lockstep", "--speed", "max")
    rows = [
        ("bare `mj_step`, same world, one process", f"{bare:.1f}", "1.00"),
        ("whole cell, running free", f"{free:.1f}", f"{free / bare:.2f}"),
        ("whole cell, lockstep", f"{lockstep:.1f}", f"{lockstep / bare:.2f}"),
    ]
    return Report(
        "Speed of the whole cell",
        "python -m benchmarks cell",
        ("variant", "x real time", "ratio to bare physics"),
        rows,
        f"World `warehouse`, {SECONDS:.0f} s of simulation with moves running all the time: four processes, lidar, "
        "odometry, localisation, planning, commands, HTTP. The bare physics stands still and senses nothing.",
    )


def bare_physics() -> float:
    from services.sim.scene import build_scene
    from services.sim.worldfile import load_world

    model = build_scene(load_world("warehouse")).model
    data = mujoco.MjData(model)
    steps = round(SECONDS / model.opt.timestep)
    mujoco.mj_step(model, data, 500)
    begun = time.perf_counter()
    mujoco.mj_step(model, data, steps)
    return SECONDS / (time.perf_counter() - begun)


def whole_cell(*options: str) -> float:
    with tempfile.TemporaryDirectory() as folder, Cell(Path(folder), *options) as cell, Judge(cell.bus) as judge:
        driver = Driver(cell, judge)
        driver.wait_until_joined()
        begun, from_stamp = time.perf_counter(), judge.now()
        passed, number = 0.0, 0
        while passed < SECONDS:
            driver.drive(standard(*GOALS[number % 2]))
            number += 1
            passed = judge.now() - from_stamp
        took = time.perf_counter() - begun
        driver.close()
        return passed / took
