"""Inverse kinematics of a serial arm as a constrained QP. Values in, values out: no bus, no clock, no I/O but the
arm's files.

    arm = load_arm("ur5e")
    ik = DifferentialIk(arm, dt=0.004)
    solution = solve_pose(arm, target, arm.home)        # a pose → joint positions
    step = ik.step(q, v, target, twist)                 # every tick: where the tool ought to be → joint velocity
    q, v = q + step.velocity * ik.dt, step.velocity

Read `arm`, then `servo` and `kernels.tick`, which it wraps; the others stand beside them.
"""

from .arm import Arm, ArmError, Limits, Sphere, build_arm, from_mujoco, load_arm
from .collision import Zone
from .objectives import ObjectiveError, Objectives
from .pose import PoseSolution, solve_pose
from .servo import DifferentialIk, Settings, Solver, Step, forward, velocity_box

__all__ = [
    "Arm",
    "ArmError",
    "DifferentialIk",
    "Limits",
    "ObjectiveError",
    "Objectives",
    "PoseSolution",
    "Settings",
    "Solver",
    "Sphere",
    "Step",
    "Zone",
    "build_arm",
    "forward",
    "from_mujoco",
    "load_arm",
    "solve_pose",
    "velocity_box",
]
