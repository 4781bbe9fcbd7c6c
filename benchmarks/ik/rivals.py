"""pink, mink and roboplan on the same arm, task and limits, where they are installed.

Each with its documented interface and a solver of its own choice that is fast and exact: a frame task of cost 1 and
gain 1, a posture of cost 1e-3 and gain 0.01. ``dt`` and ``velocity`` make a controller of them (the arm's), or the
stepper of a pose search.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from importlib.resources import files
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.ik.urdf import TOOL, to_urdf
from benchmarks.ik.walk import DT, Array, Controller
from rackhand.services.controller.ik import Arm

Make = Callable[[Arm, float, Array], Controller]


class Pink:
    """pin-pink with daqp."""

    def __init__(self, arm: Arm, dt: float, velocity: Array, accelerations: bool = False, damping: float = 0.0) -> None:
        import pink
        from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit

        self.pink, self.dt, self.name = pink, dt, "pink"
        self.limits = "position, velocity" + (", acceleration" if accelerations else "")
        model = arm.model.copy()
        model.upperVelocityLimit, model.lowerVelocityLimit = velocity, -velocity
        self.configuration = pink.Configuration(model, model.createData(), arm.home)
        self.bounds: list[Any] = [ConfigurationLimit(model), VelocityLimit(model)]
        self.acceleration = AccelerationLimit(model, arm.limits.acceleration) if accelerations else None
        if self.acceleration is not None:
            self.bounds.append(self.acceleration)
        self.task = pink.FrameTask("flange", position_cost=1.0, orientation_cost=1.0, lm_damping=damping)
        self.posture = pink.PostureTask(cost=1e-3, gain=0.01)
        self.posture.set_target(arm.home)

    def step(self, q: Array, v: Array, _now: Array, then: Array, _twist: Array) -> Array:
        self.configuration.update(q)
        self.task.set_target(pin.SE3(then[:, :3], then[:, 3]))
        if self.acceleration is not None:
            self.acceleration.set_last_integration(v, self.dt)
        tasks = [self.task, self.posture]
        return np.asarray(
            self.pink.solve_ik(
                self.configuration, tasks, self.dt, solver="daqp", limits=self.bounds, safety_break=False
            )
        )


class Mink:
    """mink with daqp; it has no acceleration limit."""

    name, limits = "mink", "position, velocity"

    def __init__(self, arm: Arm, dt: float, velocity: Array, damping: float = 0.0) -> None:
        import mink
        import mujoco

        self.mink, self.dt = mink, dt
        text = (files("rackhand.worlds.arms") / f"{arm.name}.xml").read_text(encoding="utf-8")
        model = mujoco.MjModel.from_xml_string(text)
        self.configuration = mink.Configuration(model, arm.home)
        speeds = dict(zip(arm.joints, velocity.tolist(), strict=True))
        self.bounds = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds)]
        self.task = mink.FrameTask("flange", "site", position_cost=1.0, orientation_cost=1.0, lm_damping=damping)
        self.posture = mink.PostureTask(model, cost=1e-3, gain=0.01)
        self.posture.set_target(arm.home)

    def step(self, q: Array, _v: Array, _now: Array, then: Array, _twist: Array) -> Array:
        self.configuration.update(q)
        self.task.set_target(self.mink.SE3.from_matrix(np.vstack([then, [0.0, 0.0, 0.0, 1.0]])))
        tasks = [self.task, self.posture]
        return np.asarray(self.mink.solve_ik(self.configuration, tasks, self.dt, solver="daqp", limits=self.bounds))


class Roboplan:
    """roboplan's OInK."""

    def __init__(self, arm: Arm, dt: float, velocity: Array, accelerations: bool = False, damping: float = 0.0) -> None:
        import roboplan.core as core
        import roboplan.optimal_ik as oink

        self.dt, self.name = dt, "roboplan OInK"
        self.limits = "position, velocity" + (", acceleration" if accelerations else "")
        self.scene = core.Scene(arm.name, core.loadUrdfSceneDescriptionFromXml(to_urdf(arm)))
        self.oink = oink.Oink(self.scene)
        self.pose = np.asfortranarray(np.eye(4))
        target = core.CartesianConfiguration("link0", TOOL, self.pose)
        self.task = oink.FrameTask(self.oink, self.scene, target, oink.FrameTaskOptions(lm_damping=damping))
        posture = oink.ConfigurationTask(
            self.oink, arm.home, np.full(arm.n, 1e-3), oink.ConfigurationTaskOptions(task_gain=0.01)
        )
        self.tasks = [self.task, posture]
        self.bounds = [oink.PositionLimit(self.oink), oink.VelocityLimit(self.oink, dt, velocity)]
        self.acceleration = oink.AccelerationLimit(self.oink, dt, arm.limits.acceleration) if accelerations else None
        if self.acceleration is not None:
            self.bounds.append(self.acceleration)
        self.change = np.zeros(arm.n)

    def step(self, q: Array, v: Array, _now: Array, then: Array, _twist: Array) -> Array:
        self.pose[:3] = then
        self.task.setTargetFrameTransform(self.pose)
        if self.acceleration is not None:
            self.acceleration.setLastVelocity(v)
        self.oink.solveIk(q, self.tasks, self.bounds, [], self.change)
        return self.change / self.dt


def here(*modules: str) -> bool:
    return all(importlib.util.find_spec(module) is not None for module in modules)


def rivals(arm: Arm) -> list[Controller]:
    """Those that are installed, with all the limits they have and, where acceleration is one of them, also without."""
    found: list[Controller] = []
    velocity = arm.limits.velocity
    if here("pink", "daqp"):
        found += [Pink(arm, DT, velocity), Pink(arm, DT, velocity, accelerations=True)]
    if here("mink", "daqp"):
        found.append(Mink(arm, DT, velocity))
    if here("roboplan"):
        found += [Roboplan(arm, DT, velocity), Roboplan(arm, DT, velocity, accelerations=True)]
    return found


def steppers(arm: Arm) -> list[Controller]:
    """The same as steppers of a pose search: position limits, half a radian a step, the damping of Levenberg and
    Marquardt."""
    most, found = np.full(arm.n, 0.5), []
    if here("pink", "daqp"):
        found.append(Pink(arm, 1.0, most, damping=1e-3))
    if here("mink", "daqp"):
        found.append(Mink(arm, 1.0, most, damping=1e-3))
    if here("roboplan"):
        found.append(Roboplan(arm, 1.0, most, damping=1e-3))
    return found


def missing() -> str:
    """A sentence on those that are not installed."""
    absent = [name for name in ("pink", "mink", "daqp", "roboplan") if not here(name)]
    return f"Not installed, so not compared: {', '.join(absent)}." if absent else ""
