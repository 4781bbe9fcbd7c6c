"""The compiled servo gives what its numpy form gives, and is compiled before anything waits for it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.services.sim.arm import servo as arm_servo
from rackhand.services.sim.arm.servo import HOLD, LATE, ON_TIME, POSITION, VELOCITY, JointLimits, Joints, Reference
from rackhand.services.sim.simulation import Simulation
from rackhand.worlds.world_model import load_world
from tests.sim.arm.numpy_servo import NumpyServo, let_torques
from tests.sim.helpers import EXACT

MODES = {"hold": HOLD, "position": POSITION, "velocity": VELOCITY}
STEP, N = 0.001, 6
LIMITS = JointLimits(
    np.full(N, -2.0), np.full(N, 2.0), np.full(N, 3.0), np.linspace(10, 20, N), np.linspace(30, 150, N)
)


def random_joints(rng: np.random.Generator, q: Any, dq: Any) -> tuple[Joints, Any]:
    """And their whole mass matrix."""
    root = rng.normal(size=(N, N))
    mass = root @ root.T / N + np.eye(N)
    bias, passive, damping = 10 * rng.normal(size=N), rng.normal(size=N), rng.uniform(0, 1, N)
    return Joints(q, dq, mass[np.tril_indices(N)], bias, passive, damping), mass


def wish(rng: np.random.Generator, mode: str, at: Any) -> Any:
    """Near, far and beyond the range; slow, fast and beyond the limits."""
    scale = rng.choice([1e-3, 1e-2, 0.3, 5.0])
    return at + scale * rng.normal(size=N) if mode == "position" else scale * rng.normal(size=N)


@pytest.mark.parametrize("seed", range(20))
def test_it_is_the_numpy_form_whatever_is_asked(seed: int) -> None:
    """2 s of segments and steps; the joints follow imperfectly, so that some are held back."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-2, 2, N)
    ours, oracle = Reference.at(q, np.zeros(N), STEP), NumpyServo(q, LIMITS, STEP)
    held_back = 0
    for _ in range(500):
        mode, duration = str(rng.choice(list(MODES))), rng.choice([0.002, 0.004, 0.02])
        sharpest = float(rng.choice([ON_TIME, LATE]))
        values = wish(rng, mode, oracle.position)
        passing = oracle.rate + rng.choice([0.0, 0.05, 3.0]) * rng.normal(size=N)
        arm_servo.plan(ours, MODES[mode], values, passing, LIMITS, duration, sharpest)
        oracle.plan(mode, values, passing, duration, sharpest)
        for _ in range(4):
            q = oracle.position + rng.choice([1e-4, 0.04]) * rng.normal(size=N)
            joints, mass = random_joints(rng, q, oracle.rate + 0.1 * rng.normal(size=N))
            torque = np.empty(N)
            arm_servo.hold_to(ours, joints, LIMITS, STEP, torque)
            expected = oracle.hold_to(q, joints.velocity, mass, joints.bias, joints.passive, joints.damping)
            np.testing.assert_allclose(torque, expected, rtol=1e-9, atol=1e-7)
            np.testing.assert_allclose(ours.position, oracle.position, rtol=1e-12, atol=1e-12)
            np.testing.assert_array_equal(ours.held_back, oracle.held_back)
            held_back += int(oracle.held_back.any())
    assert held_back > 50


def test_torques_are_those_of_the_numpy_form() -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        joints, mass = random_joints(rng, np.zeros(N), rng.normal(scale=2.5, size=N))
        asked, torque = rng.normal(scale=80, size=N), np.empty(N)
        arm_servo.let_torques(asked, joints, LIMITS, torque)
        expected = let_torques(asked, joints.velocity, mass, joints.bias, LIMITS)
        np.testing.assert_allclose(torque, expected, rtol=1e-9, atol=1e-9)


def test_a_constructed_world_has_compiled_all_kernels() -> None:
    """One compiled form each, so that no command waits for another."""
    Simulation(load_world("pick_station"), {}, 0, EXACT)
    kernels: tuple[Any, ...] = (
        arm_servo.plan, arm_servo.hold_to, arm_servo.let_torques, arm_servo.stream_motion, arm_servo.extrapolate
    )  # fmt: skip
    assert [len(kernel.signatures) for kernel in kernels] == [1] * 5
