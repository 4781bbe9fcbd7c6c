"""Inverse kinematics of a serial arm as a constrained QP. Values in, values out: no bus, no clock, no I/O but the
arm's files.

A pose becomes joint positions once (``solve_pose``), or a moving target becomes a joint velocity at every tick
(``DifferentialIk.step``), within position, velocity and acceleration limits that hold for any input:

    >>> import numpy as np
    >>> from rackhand.services.controller import ik
    >>> arm = ik.load_arm("ur5e")
    >>> servo = ik.DifferentialIk(arm, dt=0.004)
    >>> target = servo.forward(arm.home)
    >>> target[:, 3] += (0.05, 0.10, -0.05)
    >>> ik.solve_pose(arm, target, arm.home).reached
    True
    >>> q, v = arm.home.copy(), np.zeros(arm.n)
    >>> for _ in range(125):
    ...     step = servo.step(q, v, target)
    ...     q, v = q + step.velocity * servo.dt, step.velocity
    >>> bool(np.abs(servo.forward(q) - target).max() < 1e-4)
    True

Freedom that the task leaves goes to objective functions, switched, blended and tuned at any time; spheres of the
workspace and the arm's own are linear rows:

    >>> servo.objectives.configure("JointLimits", {"enable": True, "c": 10.0})
    >>> servo.set_zones([ik.Zone(center=(0.0, 0.6, 0.3), radius=0.1)], self_collision=True)

A velocity that a client holds is scaled down ahead of limits and singularities, so that the tool stays on its line:

    >>> twist = np.array([0.0, 0.0, 0.25, 0.0, 0.0, 0.0])
    >>> 0.0 <= servo.twist_scale(q, v, twist) <= 1.0
    True

How: the tick is one QP, min ½|J v - w|²_W + ½ μ|v - g|² in a box of velocities from which every joint can still brake,
which never is empty. Cholesky solves it while nothing binds, projected Newton when joints are at limits (both exact, a
test holds them equal to OSQP), and OSQP when rows bind. Read in this order:

    arm            an arm as the solver needs it, read from the compiled MuJoCo model
    kernels        the arithmetic, compiled; start with ``tick``
    servo          ``DifferentialIk``, which wraps ``tick`` and adds collision rows
    twist_scaling  how fast a held velocity may go
    pose           a pose by search, with restarts
    objectives     joint limits, a posture, manipulability, distance to a sphere
    collision      spheres as rows, and the guard that a clear stop exists
    solids         the links' shapes, the tool, and what surrounds the arm
    clearance      their distances: of a posture, along a path, and how fast they may get smaller
    rowqp          the QP with rows, by OSQP's low-level object
"""

from rackhand.services.controller.ik.arm import Arm, ArmError, ArmLimits, Sphere, build_arm, from_mujoco, load_arm
from rackhand.services.controller.ik.clearance import Clearance, Conflict
from rackhand.services.controller.ik.collision import Zone
from rackhand.services.controller.ik.objectives import ObjectiveError, Objectives
from rackhand.services.controller.ik.pose import PoseSolution, solve_pose
from rackhand.services.controller.ik.servo import DifferentialIk, Solver, SolverSettings, Step, forward, velocity_box
from rackhand.services.controller.ik.solids import Solid, in_station

__all__ = [
    "Arm",
    "ArmError",
    "ArmLimits",
    "Clearance",
    "Conflict",
    "DifferentialIk",
    "ObjectiveError",
    "Objectives",
    "PoseSolution",
    "Solid",
    "Solver",
    "SolverSettings",
    "Sphere",
    "Step",
    "Zone",
    "build_arm",
    "forward",
    "from_mujoco",
    "in_station",
    "load_arm",
    "solve_pose",
    "velocity_box",
]
