"""Following velocities: joints to their limits, the tool on its line."""

from __future__ import annotations

import numpy as np

from rackhand.services.controller import ik
from rackhand.services.controller.motion.meter import no_stopwatch
from rackhand.services.controller.motion.metered_solver import MeteredSolver
from rackhand.services.controller.motion.profile import MotionProfile
from rackhand.services.controller.motion.velocity import JointVelocity, TaskVelocity, VelocityFollower
from tests.controller.cell import UR5E

DT = 0.004
PROFILE = MotionProfile.default(UR5E)


def drive(follower: VelocityFollower, values: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Joint positions and velocities (m, n) from rest at home."""
    q, v = UR5E.home.copy(), np.zeros(6)
    rows = []
    for _ in range(round(seconds / DT)):
        v, _ = follower.step(values, q, v, PROFILE)
        q = q + v * DT
        rows.append((q, v))
    return np.array([row[0] for row in rows]), np.array([row[1] for row in rows])


def test_a_joint_velocity_is_reached_at_the_profiles_acceleration() -> None:
    values = np.array([0.4, -0.2, 0.0, 0.3, 0.0, 0.1])
    follower = JointVelocity(UR5E, ik.Clearance(UR5E), DT)
    _, v = drive(follower, values, 1.0)
    assert np.allclose(v[-1], values, atol=1e-9) and np.array_equal(follower.ramped, v[-1])
    acceleration = np.diff(v, axis=0) / DT
    assert (np.abs(acceleration) <= PROFILE.joint_acceleration * (1 + 1e-9)).all()


def test_a_joint_velocity_stops_at_the_end_of_the_range() -> None:
    q, v = drive(JointVelocity(UR5E, ik.Clearance(UR5E), DT), np.array([2.0, 0, 0, 0, 0, 0]), 6.0)
    assert (q <= UR5E.limits.upper + 1e-9).all() and abs(v[-1, 0]) < 1e-2
    assert q[-1, 0] > UR5E.limits.upper[0] - 0.01


def test_a_tool_velocity_keeps_the_tool_on_its_line() -> None:
    solver = MeteredSolver(ik.DifferentialIk(UR5E, DT), no_stopwatch)
    twist = np.array([0.0, 0.08, -0.04, 0.0, 0.0, 0.0])
    follower = TaskVelocity(UR5E, solver, ik.Clearance(UR5E), DT, UR5E.home)
    q, _ = drive(follower, twist, 1.0)
    start = ik.forward(UR5E, UR5E.home)
    tools = np.array([ik.forward(UR5E, each) for each in q])
    moved = tools[:, :, 3] - start[:, 3]
    along = twist[:3] / np.linalg.norm(twist[:3])
    off = np.linalg.norm(moved - np.outer(moved @ along, along), axis=1)
    assert off.max() < 2e-4
    assert np.abs(tools[:, :, :3] - start[:, :3]).max() < 1e-3
    speed = (moved[-1] - moved[-26]) @ along / (25 * DT)
    assert np.isclose(speed, np.linalg.norm(twist[:3]), rtol=0.01)
    assert solver.read()[1] >= 1 and solver.read() == (0.0, 0)
