"""pink and mink on the same arm, task and limits, where they are installed."""

from __future__ import annotations

import importlib.util
from importlib.resources import files
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from services.controller.ik import Arm

from .paths import DT, Array


class Controller(Protocol):
    """One step: commanded position and velocity, where the tool ought to be now and after the step → joint velocity."""

    name: str
    limits: str

    def step(self, q: Array, v: Array, now: Array, then: Array, twist: Array) -> Array: ...


class Pink:
    """pin-pink with its documented interface."""

    def __init__(self, arm: Arm, solver: str, accelerations: bool) -> None:
        import pink
        from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit

        self.pink, self.solver, self.name = pink, solver, f"pink, {solver}"
        self.limits = "position, velocity" + (", acceleration" if accelerations else "")
        model = arm.model.copy()
        model.upperVelocityLimit, model.lowerVelocityLimit = arm.limits.velocity, -arm.limits.velocity
        self.configuration = pink.Configuration(model, model.createData(), arm.home)
        self.bounds: list[Any] = [ConfigurationLimit(model), VelocityLimit(model)]
        self.acceleration = AccelerationLimit(model, arm.limits.acceleration) if accelerations else None
        if self.acceleration is not None:
            self.bounds.append(self.acceleration)
        self.task = pink.FrameTask("flange", position_cost=1.0, orientation_cost=1.0)
        self.posture = pink.PostureTask(cost=1e-3, gain=0.01)
        self.posture.set_target(arm.home)

    def step(self, q: Array, v: Array, _now: Array, then: Array, _twist: Array) -> Array:
        self.configuration.update(q)
        self.task.set_target(pin.SE3(then[:, :3], then[:, 3]))
        if self.acceleration is not None:
            self.acceleration.set_last_integration(v, DT)
        tasks = [self.task, self.posture]
        found = self.pink.solve_ik(
            self.configuration, tasks, DT, solver=self.solver, limits=self.bounds, safety_break=False
        )
        return np.asarray(found)


class Mink:
    """mink with its documented interface; it has no acceleration limit."""

    limits = "position, velocity"

    def __init__(self, arm: Arm, solver: str) -> None:
        import mink
        import mujoco

        self.mink, self.solver, self.name = mink, solver, f"mink, {solver}"
        text = (files("worlds.arms") / f"{arm.name}.xml").read_text(encoding="utf-8")
        model = mujoco.MjModel.from_xml_string(text)
        self.configuration = mink.Configuration(model, arm.home)
        speeds = dict(zip(arm.joints, arm.limits.velocity.tolist(), strict=True))
        self.bounds = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds)]
        self.task = mink.FrameTask("flange", "site", position_cost=1.0, orientation_cost=1.0)
        self.posture = mink.PostureTask(model, cost=1e-3, gain=0.01)
        self.posture.set_target(arm.home)

    def step(self, q: Array, _v: Array, _now: Array, then: Array, _twist: Array) -> Array:
        self.configuration.update(q)
        self.task.set_target(self.mink.SE3.from_matrix(np.vstack([then, [0.0, 0.0, 0.0, 1.0]])))
        found = self.mink.solve_ik(
            self.configuration, [self.task, self.posture], DT, solver=self.solver, limits=self.bounds
        )
        return np.asarray(found)


def rivals(arm: Arm) -> tuple[list[Controller], str]:
    """Those that are installed, and a sentence on those that are not."""
    found: list[Controller] = []
    here = {name: importlib.util.find_spec(name) is not None for name in ("pink", "mink", "daqp")}
    solver = "daqp" if here["daqp"] else "osqp"
    if here["pink"]:
        found += [Pink(arm, solver, False), Pink(arm, solver, True)]
    if here["mink"]:
        found.append(Mink(arm, solver))
    missing = [name for name in ("pink", "mink") if not here[name]]
    return found, f"Not installed, so not compared: {', '.join(missing)}." if missing else ""
