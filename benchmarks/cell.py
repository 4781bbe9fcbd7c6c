"""How fast the whole cell runs while a move is driven: free and in lockstep, beside the bare physics of one run."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mujoco

from benchmarks.report import Report
from rackhand.schemas.base import NANOSECONDS
from rackhand.services.sim.simulation import Simulation
from rackhand.testing import Cell, Judge
from rackhand.testing.ports import free_port
from rackhand.worlds.chassis_model import load_profiles
from rackhand.worlds.world_model import World, load_world
from tests.system.driving import Driver, standard

SECONDS = 30.0  # of simulation time, each
GOALS = ((9.0, 7.3), (2.5, 7.3))
SERVICES = ("router", "sim", "planner", "controller", "gateway")


def run() -> Report:
    world = load_world("warehouse")
    bare = bare_physics(world)
    measured: dict[str, tuple[float, str]] = {
        "bare `mj_step`, same world, one process": (bare, ""),
        "simulator's core with sensors, no bus": (core(world), ""),
        "simulator on the bus, nobody commands": (simulator_alone(), ""),
        "whole cell, running free": whole_cell("--speed", "max"),
        "whole cell, lockstep": whole_cell("--lockstep", "--speed", "max"),
    }
    return Report(
        "Speed of the whole cell",
        "python -m benchmarks cell",
        ("variant", "x real time", "ratio to bare physics", "CPU ms per simulated second"),
        [(name, f"{speed:.1f}", f"{speed / bare:.2f}", cpu) for name, (speed, cpu) in measured.items()],
        f"World `warehouse`, {SECONDS:.0f} s of simulation each. The cell is five processes. The chassis drives moves "
        "all the time, the arm is commanded 250 times a simulated second: physics at 1 kHz, the arm's servo, lidar, "
        "odometry, localisation, planning, control, commands, HTTP. Bare physics: the robots do not move, and there "
        "are no sensors.",
    )


def bare_physics(world: World) -> float:
    simulation = Simulation(world, load_profiles(world), seed=0)
    model, data = simulation.model, mujoco.MjData(simulation.model)
    data.qpos[:] = simulation.data.qpos
    for arm in world.arms:  # they would fall: nobody drives their motors
        joints = [j for j in range(model.njnt) if model.joint(j).name.startswith(f"{arm}/")]
        model.dof_damping[model.jnt_dofadr[joints]] = 1e6
    steps = round(SECONDS / model.opt.timestep)
    mujoco.mj_step(model, data, 500)
    begun = time.perf_counter()
    mujoco.mj_step(model, data, steps)
    return SECONDS / (time.perf_counter() - begun)


def core(world: World) -> float:
    simulation = Simulation(world, load_profiles(world), seed=0)
    begun = time.perf_counter()
    while simulation.stamp < SECONDS * NANOSECONDS:
        simulation.step()
    return SECONDS / (time.perf_counter() - begun)


def simulator_alone() -> float:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    environment = {**os.environ, "RACKHAND_BUS_CONNECT": endpoint}
    commands = (
        ["rackhand.bus.router", "--listen", endpoint],
        ["rackhand.services.sim", "--world", "warehouse", "--speed", "max"],
    )
    processes = [subprocess.Popen([sys.executable, "-m", *command], env=environment) for command in commands]
    try:
        with Judge(endpoint) as judge:
            begun, from_stamp = time.perf_counter(), judge.now()
            while (passed := judge.now() - from_stamp) < SECONDS:
                time.sleep(0.2)
            return passed / (time.perf_counter() - begun)
    finally:
        for process in processes:
            process.terminate()
            process.wait(timeout=10)


def whole_cell(*options: str) -> tuple[float, str]:
    """Times real time, and the processor time of each service in ms per simulated second."""
    with (
        tempfile.TemporaryDirectory() as folder,
        Cell(Path(folder), *options, lockstep="--lockstep" in options) as cell,
        Judge(cell.bus) as judge,
    ):
        driver = Driver(cell, judge)
        driver.wait_until_joined()
        pids = {service: cell.pid(service) for service in SERVICES}
        before = {service: cpu_seconds(pid) for service, pid in pids.items()}
        begun, from_stamp = time.perf_counter(), judge.now()
        passed, number = 0.0, 0
        while passed < SECONDS:
            driver.drive(standard(*GOALS[number % 2]))
            number += 1
            passed = judge.now() - from_stamp
        took = time.perf_counter() - begun
        used = {service: 1000 * (cpu_seconds(pid) - before[service]) / passed for service, pid in pids.items()}
        driver.close()
        parts = ", ".join(f"{service} {milliseconds:.0f}" for service, milliseconds in used.items())
        return passed / took, f"{sum(used.values()):.0f} ({parts})"


def cpu_seconds(pid: int) -> float:
    """Processor time of a process and all its threads, from proc(5)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
