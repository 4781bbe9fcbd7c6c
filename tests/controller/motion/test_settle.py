"""After a stop the arm is held where it is, also one that something pressed and that springs back."""

from __future__ import annotations

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.schemas.motion import ArmState
from rackhand.services.controller.motion.executor import SETTLED_TIME, MotionExecutor
from tests.controller.cell import UR5E

DT = 0.004


class Stopped:
    """A motion that was stopped at home. The arm is where the test says."""

    def __init__(self, contact: bool) -> None:
        self.motion = MotionExecutor(UR5E, DT)
        self.stamp = 0
        self.motion.begin_at(self.state(UR5E.home, np.zeros(6)), 0.0)
        self.motion.soft_stop()
        if contact:
            self.motion.touched()
        self.commanded: list[Array] = []

    def state(self, q: Array, v: Array) -> ArmState:
        still = (0.0,) * 6
        return ArmState(stamp=self.stamp, q=tuple(q), dq=tuple(v), efforts=still, wrench=still)

    def tick(self, off: float, speed: float = 0.0) -> Array:
        """The arm is ``off`` [rad] from home at all joints and moves with ``speed``; what is commanded, from home."""
        state = self.state(UR5E.home + off, np.full(6, speed))
        self.motion.settle(state)
        self.motion.tick(self.stamp * 1e-9, state)
        self.stamp += round(DT * 1e9)
        self.commanded.append(self.motion.q.copy())
        return np.asarray(self.motion.q - UR5E.home)


def test_an_arm_that_springs_back_is_held_where_it_comes_to_rest() -> None:
    """It is at rest for a moment while the force that pressed it fades, and moves only then."""
    arm = Stopped(contact=True)
    for _ in range(10):
        assert np.allclose(arm.tick(0.05), 0.05, atol=1e-9)
    for k in range(25):
        arm.tick(0.05 - 0.001 * k, -0.25)
    for _ in range(100):
        held = arm.tick(0.025)
    assert np.allclose(held, 0.025, atol=1e-3)


def test_what_springs_back_is_stopped_within_its_limits_not_followed() -> None:
    """Were the command to go along with what moves, nothing would brake it."""
    arm = Stopped(contact=True)
    for k in range(10):
        arm.tick(0.05 - 0.002 * k, -0.5)
    speeds = np.diff(arm.commanded, axis=0) / DT
    assert np.abs(speeds[1:]).max() < 0.5 and np.abs(speeds[-1]).max() < np.abs(speeds[1]).max()
    assert (np.abs(np.diff(speeds[1:], axis=0)) / DT <= UR5E.limits.acceleration * 1.01).all()


def test_what_is_driven_off_is_held_back_and_held_where_it_comes_to_rest() -> None:
    """A tool that slides along what it touches would be led on by a position that goes along with it."""
    arm = Stopped(contact=True)
    for k in range(25):
        assert np.allclose(arm.tick(0.02 + 0.002 * k, 0.5), 0.0)
    for _ in range(10):
        held = arm.tick(0.07)
    assert np.allclose(held, 0.07, atol=1e-9)


def test_once_settled_it_holds_against_what_pushes() -> None:
    arm = Stopped(contact=False)
    for _ in range(round(SETTLED_TIME / DT) + 2):
        arm.tick(0.0)
    assert np.allclose(arm.tick(0.03), 0.0)


def test_within_what_a_stop_may_be_off_nothing_is_changed() -> None:
    arm = Stopped(contact=False)
    for _ in range(100):
        assert np.allclose(arm.tick(0.008), 0.0)
