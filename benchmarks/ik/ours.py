"""rackhand's own solver as a controller."""

from __future__ import annotations

from benchmarks.ik.walk import DT, Array
from rackhand.services.controller.ik import Arm, DifferentialIk


class Ours:
    """``DifferentialIk`` with a posture objective."""

    name, limits = "rackhand", "position, velocity, acceleration"

    def __init__(self, arm: Arm) -> None:
        self.ik = DifferentialIk(arm, DT, blend_time=0.0)
        self.ik.objectives.configure("DesiredJointPositions", {"enable": True, "attraction": arm.home, "c": 5.0})

    def step(self, q: Array, v: Array, now: Array, _then: Array, twist: Array) -> Array:
        return self.ik.step(q, v, now, twist).velocity


class OursWithRows(Ours):
    """The same with all of the arm's own spheres against each other."""

    name = "rackhand, self-collision rows"

    def __init__(self, arm: Arm) -> None:
        super().__init__(arm)
        self.ik.set_zones((), self_collision=True)
        self.limits = f"the same and {len(arm.self_collision)} gaps"
