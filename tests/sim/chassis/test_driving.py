"""Wheels on contacts: how far a chassis really goes, what its odometry says of it, and when it stops."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.world import InjectFault, MoveRobot
from rackhand.services.sim.chassis.drive import WheelTargets, approach, follow, is_fresh
from rackhand.services.sim.chassis.noise import NoiseSettings
from rackhand.services.sim.simulation import CONTROL_STEP_NS
from rackhand.worlds.chassis_model import load_profile
from tests.sim.helpers import STILL, coast, drive, make_simulation, make_world, newest


def test_straight_drive_goes_as_far_as_odometry_says() -> None:
    simulation = make_simulation()
    drive(simulation, 4.0, linear=0.6)
    drive(simulation, 1.0)
    x, y, yaw = simulation.robots["amr1"].pose
    odometry = newest(simulation, topics.ODOMETRY)
    # 4 s at 0.6 m/s; the ramp of 0.4 s up loses what the ramp of 0.24 s down gives back, but for 0.048 m.
    assert x == pytest.approx(2.4 - 0.048, abs=0.02)
    assert (x, y, yaw) == pytest.approx((odometry.pose.x, odometry.pose.y, odometry.pose.yaw), abs=0.005)


def test_spin_on_the_spot_does_not_scrub() -> None:
    simulation = make_simulation()
    drive(simulation, 2.5, angular=1.0)
    drive(simulation, 1.0)
    x, y, yaw = simulation.robots["amr1"].pose
    assert yaw == pytest.approx(2.5, abs=0.03)
    assert yaw == pytest.approx(newest(simulation, topics.ODOMETRY).pose.yaw, rel=0.002)
    assert math.hypot(x, y) < 0.005


def test_jackal_reaches_two_metres_a_second_without_slipping() -> None:
    world = make_world(robots={"amr1": {"profile": "jackal", "pose": (0, 0, 0)}})
    simulation = make_simulation(world)
    drive(simulation, 1.5, linear=2.0)
    odometry = newest(simulation, topics.ODOMETRY)
    assert odometry.twist.linear == pytest.approx(2.0, rel=0.01)
    assert simulation.robots["amr1"].pose[0] == pytest.approx(odometry.pose.x, rel=0.01)


def test_odometry_integrates_noisy_encoders_and_not_the_truth() -> None:
    simulation = make_simulation(noise=NoiseSettings())
    drive(simulation, 4.0, linear=1.0)
    way = newest(simulation, topics.ODOMETRY).pose.x
    truth = simulation.robots["amr1"].pose[0]
    assert way != pytest.approx(truth, abs=1e-6)
    assert way == pytest.approx(truth, rel=0.01)


def test_odometry_does_not_notice_being_carried() -> None:
    simulation = make_simulation()
    drive(simulation, 0.5, linear=0.5)
    before = newest(simulation, topics.ODOMETRY).pose
    simulation.change(MoveRobot(robot="amr1", pose=Pose2(x=5.0, y=5.0, yaw=1.0)))
    coast(simulation, 0.02)
    assert simulation.robots["amr1"].pose == pytest.approx((5.0, 5.0, 1.0), abs=1e-3)
    assert newest(simulation, topics.ODOMETRY).pose.x == pytest.approx(before.x, abs=1e-3)


def test_limits_of_the_drive_hold_for_any_command() -> None:
    simulation = make_simulation()
    speeds = [m.twist.linear for t, m in drive(simulation, 1.5, linear=50.0) if t is topics.ODOMETRY]
    limits = simulation.robots["amr1"].profile.drive
    assert max(speeds) == pytest.approx(limits.max_linear, rel=0.02)
    steps = [(b - a) * 1e9 / CONTROL_STEP_NS for a, b in pairwise(speeds)]
    assert max(steps) < 1.2 * limits.acceleration


def test_stale_commands_stop_the_wheels() -> None:
    """They are braked from 100 ms after the instant they answer, as hard as the grip allows."""
    simulation = make_simulation()
    drive(simulation, 1.5, linear=0.8)
    last = simulation.robots["amr1"].command
    assert last is not None
    rolling = [m for t, m in coast(simulation, 0.4) if t is topics.ODOMETRY]
    before = [m for m in rolling if m.stamp <= last.answers + 100_000_000]
    after = [m for m in rolling if m.stamp > last.answers + 200_000_000]
    assert len(before) == 4 and min(m.twist.linear for m in before) > 0.79
    assert max(m.twist.linear for m in after) < 0.08
    x = simulation.robots["amr1"].pose[0]
    coast(simulation, 0.1)
    assert simulation.robots["amr1"].pose[0] == pytest.approx(x, abs=1e-4)


def test_a_robot_without_commands_stops_within_200_ms() -> None:
    simulation = make_simulation()
    drive(simulation, 1.5, linear=0.8)
    simulation.silence("amr1")
    coast(simulation, 0.18)
    x = simulation.robots["amr1"].pose[0]
    coast(simulation, 0.1)
    assert simulation.robots["amr1"].pose[0] == pytest.approx(x, abs=0.002)


def test_a_command_lives_100_ms() -> None:
    command = ChassisCommand(answers=1_000_000_000, twist=STILL)
    assert is_fresh(command, 1_080_000_000)
    assert not is_fresh(command, 1_100_000_000)
    assert not is_fresh(None, 0)


def test_commands_of_another_run_and_older_ones_are_not_taken() -> None:
    simulation = make_simulation()
    coast(simulation, 0.2)
    twist = Twist2(linear=0.1, angular=0.0)
    assert simulation.command("amr1", ChassisCommand(answers=200_000_000, twist=twist))
    assert not simulation.command("amr1", ChassisCommand(answers=200_000_001, twist=STILL))
    assert not simulation.command("amr1", ChassisCommand(answers=160_000_000, twist=STILL))
    assert not simulation.command("nobody", ChassisCommand(answers=0, twist=STILL))
    assert simulation.robots["amr1"].command == ChassisCommand(answers=200_000_000, twist=twist)


@pytest.mark.parametrize("fault", ["emergency_stop_button", "wheels_blocked"])
def test_a_fault_of_the_drive_stops_it_against_its_commands(fault: str) -> None:
    simulation = make_simulation()
    drive(simulation, 1.0, linear=0.8)
    simulation.change(InjectFault.model_validate({"target": "amr1", "fault": fault}))
    drive(simulation, 0.5, linear=0.8)
    assert newest(simulation, topics.ODOMETRY).twist.linear == pytest.approx(0.0, abs=0.01)
    simulation.change(InjectFault.model_validate({"target": "amr1", "fault": fault, "active": False}))
    drive(simulation, 1.0, linear=0.8)
    assert newest(simulation, topics.ODOMETRY).twist.linear == pytest.approx(0.8, rel=0.02)


@pytest.mark.parametrize(
    ("now", "wanted", "then"),
    [(0.0, 1.0, 0.1), (1.0, 0.0, 0.8), (0.05, -1.0, 0.0), (-0.5, -1.0, -0.6), (0.95, 1.0, 1.0)],
)
def test_approach(now: float, wanted: float, then: float) -> None:
    assert approach(now, wanted, up=0.1, down=0.2) == pytest.approx(then)


def test_follow_limits_twists_and_not_wheels() -> None:
    """A turn asked for together with a long acceleration is not made wider by it."""
    kind = load_profile("longjack").drive
    targets = WheelTargets(0.0, 0.0)
    for _ in range(200):
        targets = follow(targets, Twist2(linear=1.0, angular=0.5), kind, 0.02)
    assert targets.left == pytest.approx(1.0 - 0.25 * kind.wheel_separation)
    assert targets.right == pytest.approx(1.0 + 0.25 * kind.wheel_separation)
