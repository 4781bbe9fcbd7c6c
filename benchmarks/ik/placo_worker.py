"""placo and the floor beside it, in an environment of their own: pickled requests on standard input, answers on
standard output. See ``placo_process``, which starts it.
"""

from __future__ import annotations

import os
import pickle
import sys

import numpy as np
import pinocchio as pin
import placo

from benchmarks.ik.floor import Bare
from benchmarks.ik.search import search_all
from benchmarks.ik.walk import DT, Array, Walker


class Placo:
    """placo with its documented interface: a frame task, and regularisation with a posture that together draw there
    with a gain of 0.01; it has no acceleration limit. ``velocity`` None: the limits of the URDF."""

    name, limits = "placo", "position, velocity"

    def __init__(self, urdf: str, joints: list[str], home: Array, dt: float, velocity: float | None = None) -> None:
        self.dt, self.n = dt, len(joints)
        self.robot = placo.RobotWrapper("", placo.Flags.ignore_collisions, urdf)
        if velocity is not None:
            self.robot.set_velocity_limits(velocity)
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.dt = dt
        self.solver.mask_fbase(True)
        self.solver.enable_joint_limits(True)
        self.solver.enable_velocity_limits(True)
        self.pose = np.eye(4)
        self.task = self.solver.add_frame_task("flange", self.pose)
        self.task.configure("flange", "soft", 1.0, 1.0)
        self.solver.add_regularization_task(1e-6)
        posture = self.solver.add_joints_task()
        posture.set_joints(dict(zip(joints, home.tolist(), strict=True)))
        posture.configure("posture", "soft", 1e-8)
        self.state = self.robot.state.q.copy()

    def step(self, q: Array, _v: Array, _now: Array, then: Array, _twist: Array) -> Array:
        self.state[7:] = q
        self.robot.state.q = self.state
        self.robot.update_kinematics()
        self.pose[:3] = then
        self.task.T_world_frame = self.pose
        return np.asarray(self.solver.solve(False)[6:]) / self.dt


def main() -> None:
    # Whatever a library prints must not end up among the answers.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    walkers: list[Walker] = []
    while True:
        try:
            kind, content = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        if kind == "arm":
            urdf, joints, home, lower, upper = content
            model = pin.buildModelFromXML(urdf)
            bare, answer = Bare(model, model.getFrameId("flange")), None
        elif kind == "course":
            walkers, answer = [Walker(bare, content), Walker(Placo(urdf, joints, home, DT), content)], None
        elif kind == "walk":
            answer = [walker.walk(content) for walker in walkers]
        else:
            stepper = Placo(urdf, joints, home, 1.0, velocity=0.5)
            answer = search_all(stepper, bare.distance, lower, upper, content)
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    main()
