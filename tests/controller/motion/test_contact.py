"""What the contact watch finds in arm states: at the flange, in a joint, and in what is no contact."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rackhand.schemas.arrays import Array
from rackhand.schemas.crf_contact import Contact
from rackhand.schemas.motion import ArmState
from rackhand.services.controller.motion.contact import ContactBounds, ContactWatch, describe
from rackhand.services.controller.motion.disturbance import DisturbanceObserver, resting_efforts
from rackhand.services.controller.motion.kinematics import ArmKinematics
from tests.controller.cell import UR5E

PERIOD_NS = 4_000_000
BOUNDS = ContactBounds()
KINEMATICS = ArmKinematics(UR5E)
ROTATION = KINEMATICS.forward(UR5E.home).rotation


class Watched:
    """An arm at rest at home, whose motors carry its weight and what the tool does to the flange."""

    def __init__(self) -> None:
        self.watch, self.stamp = ContactWatch(UR5E), 0

    def see(
        self, force: Array, off: Array | None = None, extra: Array | None = None, catching_up: bool = False
    ) -> Contact | None:
        """``force`` (3,) [N] of the tool on the flange, base axes; ``off`` (n,) [rad] its command; ``extra`` (n,) [N·m]
        that something else pushes with."""
        wrench = np.concatenate([ROTATION.T @ force, np.zeros(3)])
        load = KINEMATICS.jacobian(UR5E.home).T @ np.concatenate([force, np.zeros(3)])
        efforts = resting_efforts(UR5E, UR5E.home) - load - (np.zeros(6) if extra is None else extra)
        state = ArmState(
            stamp=self.stamp, q=tuple(UR5E.home), dq=(0.0,) * 6, efforts=tuple(efforts), wrench=tuple(wrench)
        )
        self.stamp += PERIOD_NS
        commanded = UR5E.home if off is None else UR5E.home + off
        return self.watch.see(state, commanded, ROTATION, catching_up)

    def meanwhile(self, seconds: float, force: Array) -> list[Contact | None]:
        return [self.see(force) for _ in range(round(seconds * 1e9) // PERIOD_NS)]


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 0, 1), (0, 0, -1), (0.6, -0.8, 0)])
def test_a_force_at_the_flange_is_found_though_the_motors_hold_it(direction: tuple[float, float, float]) -> None:
    arm, weight = Watched(), np.array([0.0, 0.0, -20.0])
    assert not any(arm.meanwhile(1.0, weight))
    pushed = weight + 1.5 * BOUNDS.force * np.array(direction)
    found = [arm.see(pushed) for _ in range(BOUNDS.ticks)]
    assert found[:-1] == [None] * (BOUNDS.ticks - 1)
    contact = found[-1]
    assert contact is not None and contact.kind == "force" and contact.joint is None
    assert contact.bound == BOUNDS.force and BOUNDS.force < contact.value < 1.5 * BOUNDS.force + 1e-9
    assert describe(contact).startswith("at the flange: force of 1") and describe(contact).endswith("bound 80 N")


def test_a_force_below_the_bound_is_none() -> None:
    arm = Watched()
    arm.meanwhile(0.5, np.zeros(3))
    assert not any(arm.meanwhile(1.0, np.array([0.95 * BOUNDS.force, 0.0, 0.0])))


def test_a_load_that_grows_slowly_is_none() -> None:
    """In a second what the flange carries is another weight."""
    arm = Watched()
    arm.meanwhile(0.5, np.zeros(3))
    forces = np.linspace(0.0, 2.0 * BOUNDS.force, 250)
    assert not any(arm.see(np.array([0.0, 0.0, -force])) for force in forces)


def test_a_blow_of_one_period_is_none() -> None:
    arm = Watched()
    arm.meanwhile(0.5, np.zeros(3))
    arm.see(np.array([2.0 * BOUNDS.force, 0.0, 0.0]))
    assert not any(arm.meanwhile(0.5, np.zeros(3)))


@pytest.mark.parametrize("joint", range(6))
def test_a_push_at_a_link_is_found_with_its_joint(joint: int) -> None:
    arm = Watched()
    arm.meanwhile(0.2, np.zeros(3))
    extra = 2.0 * BOUNDS.torque * UR5E.limits.torque * np.eye(6)[joint]
    found = next(contact for _ in range(25) if (contact := arm.see(np.zeros(3), extra=extra)))
    assert (found.kind, found.joint, found.unit) == ("torque", joint, "N·m")


@pytest.mark.parametrize("joint", range(6))
def test_a_joint_that_does_not_follow_is_found(joint: int) -> None:
    arm = Watched()
    off = 1.1 * BOUNDS.following * np.eye(6)[joint]
    found = [arm.see(np.zeros(3), off=off) for _ in range(BOUNDS.ticks)][-1]
    assert found is not None and (found.kind, found.joint) == ("following", joint)


def test_an_arm_that_catches_up_may_be_off_its_command_and_is_watched_for_the_rest() -> None:
    arm, off = Watched(), 2.0 * BOUNDS.following * np.ones(6)
    assert not any(arm.see(np.zeros(3), off=off, catching_up=True) for _ in range(50))
    extra = 2.0 * BOUNDS.torque * UR5E.limits.torque * np.eye(6)[1]
    found = [arm.see(np.zeros(3), off=off, extra=extra, catching_up=True) for _ in range(25)]
    assert any(contact is not None and (contact.kind, contact.joint) == ("torque", 1) for contact in found)


def test_what_the_efforts_were_while_states_were_missed_is_not_known() -> None:
    """The same motion with and without the states in the middle of it, where the motors gave what is in no state."""
    observer, period = DisturbanceObserver(UR5E), PERIOD_NS
    rest = resting_efforts(UR5E, UR5E.home)

    def see(stamp: int, speed: float) -> Array:
        q, dq = tuple(UR5E.home), (speed, *(0.0,) * 5)
        return observer.see(ArmState(stamp=stamp, q=q, dq=dq, efforts=tuple(rest), wrench=(0.0,) * 6))

    see(0, 0.0)
    assert np.abs(see(2 * period, 0.1)).max() == 0.0, "braked or not, who knows"
    assert np.abs(see(3 * period, 0.2)).max() > 1.0, "sped up without a torque"


def moving_in_bursts(share: float, missed: frozenset[int] = frozenset()) -> float:
    """An arm that gains its speed in every other half of a period, by motors that give just the torque for that, and
    whose driver publishes two states in a period; those numbered in ``missed`` are lost. The greatest torque [N·m] of
    joint 1 that the observer finds. ``share`` of the torque between two ticks something else gives."""
    observer, data, half = DisturbanceObserver(UR5E), UR5E.model.createData(), PERIOD_NS // 2
    q, v, found = UR5E.home.copy(), np.zeros(6), 0.0
    for i in range(200):
        bursts = i % 4 in (1, 2)  # to a tick, and from one
        a = np.array([0.0, 5.0 * bursts * (1 if i % 8 < 4 else -1), 0.0, 0.0, 0.0, 0.0])
        middle, dt = v + 0.5 * a * half * 1e-9, half * 1e-9
        efforts = pin.rnea(UR5E.model, data, q + 0.5 * dt * middle, middle, a) + UR5E.model.damping * middle
        if i % 2:
            efforts[1] -= share * UR5E.limits.torque[1]
        q, v = q + dt * middle, v + dt * a
        state = ArmState(stamp=i * half, q=tuple(q), dq=tuple(v), efforts=tuple(efforts), wrench=(0.0,) * 6)
        if i not in missed:
            observer.take(state)
            if i % 2 == 0:
                found = max(found, abs(float(observer.see(state)[1])))
    return found


def test_of_a_driver_with_more_states_than_ticks_every_effort_counts() -> None:
    """Each is a mean since the state before: what the motors did before a state that nobody answers moved the arm."""
    torque = float(UR5E.limits.torque[1])
    assert moving_in_bursts(0.0) < 0.01 * BOUNDS.torque * torque
    assert moving_in_bursts(0.4) == pytest.approx(0.2 * torque, rel=0.05), "half of the time with 0.4 of the limit"


def test_between_two_ticks_a_lost_state_is_no_push() -> None:
    lost = frozenset(range(21, 200, 10))
    assert moving_in_bursts(0.0, lost) < 0.01 * BOUNDS.torque * UR5E.limits.torque[1]
    assert moving_in_bursts(0.4, lost) > 1.2 * BOUNDS.torque * UR5E.limits.torque[1], "and the others are looked at"
