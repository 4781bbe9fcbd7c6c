"""What a chassis measures, against what is known to be there."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.topics import Topic
from rackhand.schemas.world import InjectFault, Place
from rackhand.services.sim.chassis.battery import BatteryModel
from rackhand.services.sim.chassis.noise import NoiseSettings, PoseNoise, generator
from rackhand.services.sim.simulation import CONTROL_STEP_NS, Simulation
from rackhand.worlds.chassis_model import BatteryKind, load_profile
from tests.sim.helpers import EXACT, coast, drive, make_simulation, make_world, newest

WALL = {"wall_east": {"kind": "wall", "start": (3.1, -9), "end": (3.1, 9), "thickness": 0.2}}


def inject(simulation, fault: str, active: bool = True) -> None:  # type: ignore[no-untyped-def]
    simulation.change(InjectFault.model_validate({"target": "amr1", "fault": fault, "active": active}))


def test_lidar_measures_a_wall_along_every_beam() -> None:
    scan = newest(make_simulation(make_world(statics=WALL)), topics.SCAN)
    angles = scan.angle_min + scan.angle_step * np.arange(len(scan.ranges))
    towards = np.abs(angles) < math.radians(60)
    expected = (3.0 - scan.sensor.x) / np.cos(angles[towards])
    np.testing.assert_allclose(scan.ranges[towards], expected, atol=1e-4)
    behind = np.abs(angles) > math.radians(100)
    assert np.isposinf(scan.ranges[behind]).all(), "it must neither see itself nor the floor"


def test_lidar_sees_the_legs_of_a_rack_and_not_its_boards() -> None:
    world = make_world(
        rack_kinds={"standard": {"size": (0.8, 0.8), "underside": 0.285, "height": 1.4, "mass": 90}},
        racks={"rack_1": {"kind": "standard", "pose": (2.0, 0.0, 0.0)}},
    )
    scan = newest(make_simulation(world), topics.SCAN)
    angles = scan.angle_min + scan.angle_step * np.arange(len(scan.ranges))
    hit = np.isfinite(scan.ranges)
    x = scan.sensor.x + scan.ranges[hit] * np.cos(angles[hit])
    y = scan.ranges[hit] * np.sin(angles[hit])
    assert 4 <= hit.sum() < 40
    assert np.all((np.abs(np.abs(y) - 0.385) < 0.016) & (np.abs(np.abs(x - 2.0) - 0.385) < 0.016))


@pytest.mark.parametrize(("kind", "size", "distance"), [("box", (0.4, 1.0, 0.5), 1.8), ("cylinder", (0.3, 0.5), 1.7)])
def test_lidar_sees_what_was_placed_at_its_size(kind: str, size: tuple[float, ...], distance: float) -> None:
    simulation = make_simulation()
    simulation.change(
        Place.model_validate({"name": "thing", "kind": kind, "pose": Pose2(x=2.0, y=0, yaw=0), "size": size})
    )
    coast(simulation, 0.08)
    scan = newest(simulation, topics.SCAN)
    assert np.min(scan.ranges) == pytest.approx(distance - scan.sensor.x, abs=1e-3)
    width = 1.0 if kind == "box" else 0.6
    seen = np.count_nonzero(np.isfinite(scan.ranges)) * scan.angle_step
    assert seen == pytest.approx(2 * math.atan(width / 2 / (2.0 - scan.sensor.x)), rel=0.15)


def test_lidar_sees_other_robots_and_not_itself() -> None:
    robots = {
        "amr1": {"profile": "longjack", "pose": (0, 0, 0)},
        "amr2": {"profile": "jackal", "pose": (2, 0, math.pi)},
    }
    simulation = make_simulation(make_world(robots=robots))
    scans = {o.robot: o.message for o in simulation.outputs if o.topic is topics.SCAN}
    assert np.min(scans["amr1"].ranges) == pytest.approx(2.0 - 0.254 - 0.2, abs=1e-3)
    assert np.min(scans["amr2"].ranges) == pytest.approx(2.0 - 0.375 - 0.12, abs=1e-3)
    assert len(scans["amr2"].ranges) == 720
    assert scans["amr2"].angle_step * 719 == pytest.approx(1.5 * math.pi)


def test_lidar_noise_has_the_stated_sigma() -> None:
    world = make_world(statics=WALL)
    exact = newest(make_simulation(world), topics.SCAN).ranges
    noisy = newest(make_simulation(world, noise=NoiseSettings()), topics.SCAN).ranges
    seen = np.isfinite(exact)
    errors = noisy[seen] - exact[seen]
    assert np.std(errors) == pytest.approx(0.01, rel=0.2)


def test_dead_lidar_is_silent_and_a_blind_one_measures_nothing() -> None:
    simulation = make_simulation(make_world(statics=WALL))
    inject(simulation, "lidar_dead")
    assert not [m for t, m in coast(simulation, 0.4) if t is topics.SCAN]
    inject(simulation, "lidar_dead", active=False)
    inject(simulation, "lidar_blind")
    blind = [m for t, m in coast(simulation, 0.4) if t is topics.SCAN]
    assert len(blind) == 5 and all(np.isnan(m.ranges).all() for m in blind)


def test_lost_pose_is_not_published() -> None:
    simulation = make_simulation()
    inject(simulation, "pose_lost")
    assert not [m for t, m in coast(simulation, 0.4) if t is topics.POSE]
    inject(simulation, "pose_lost", active=False)
    assert [m for t, m in coast(simulation, 0.4) if t is topics.POSE]


def test_switches_follow_their_faults() -> None:
    simulation = make_simulation()
    inject(simulation, "power_cable")
    inject(simulation, "emergency_stop_button")
    coast(simulation, 0.1)
    contacts = newest(simulation, topics.CONTACTS)
    assert contacts.power_cable and contacts.emergency_stop_button
    assert not contacts.bumper_front and not contacts.charge_contact


def test_imu_feels_gravity_and_turning() -> None:
    simulation = make_simulation()
    drive(simulation, 1.5, angular=0.8)
    imu = newest(simulation, topics.IMU)
    assert imu.angular_velocity[2] == pytest.approx(0.8, abs=0.01)
    assert imu.linear_acceleration[2] == pytest.approx(9.81, abs=0.05)


def test_imu_feels_acceleration_forwards() -> None:
    simulation = make_simulation()
    felt = [m.linear_acceleration[0] for t, m in drive(simulation, 0.4, linear=1.2) if t is topics.IMU]
    assert np.median(felt[5:]) == pytest.approx(1.5, rel=0.15)


def test_pose_noise_keeps_its_sigma_and_wanders_slowly() -> None:
    noise = PoseNoise(NoiseSettings(), generator(0, "amr1", "pose"), 0.04)
    errors = np.array([noise.draw() for _ in range(20_000)])
    np.testing.assert_allclose(errors.std(axis=0), [0.01, 0.01, 0.005], rtol=0.15)
    x = errors[:, 0]
    assert np.corrcoef(x[:-1], x[1:])[0, 1] == pytest.approx(0.64, abs=0.08)


def test_localised_pose_is_the_truth_when_noise_is_off() -> None:
    simulation = make_simulation(make_world(robots={"amr1": {"profile": "longjack", "pose": (1, 2, 3)}}))
    pose = newest(simulation, topics.POSE).pose
    assert (pose.x, pose.y, pose.yaw) == pytest.approx((1, 2, 3), abs=1e-3)


@pytest.mark.parametrize(
    ("topic", "period"),
    [
        (topics.IMU, 20),
        (topics.SCAN, 80),
        (topics.POSE, 40),
        (topics.JACK, 200),
        (topics.BATTERY, 1000),
        (topics.CONTACTS, 100),
        (topics.OBJECTS, 40),
        (topics.ODOMETRY, 20),
    ],
)
def test_everything_is_due_on_multiples_of_its_period_and_first_at_zero(topic: Topic, period: int) -> None:  # type: ignore[type-arg]
    simulation = make_simulation()
    due = [simulation.stamp] if newest(simulation, topic) else []
    for _ in range(50):
        simulation.step()
        message = newest(simulation, topic)
        if message is not None:
            assert message.stamp == simulation.stamp
            due.append(simulation.stamp)
    assert due == list(range(0, 50 * CONTROL_STEP_NS + 1, period * 1_000_000))


def test_odometry_is_the_last_of_a_step() -> None:
    simulation = make_simulation()
    order = [o.topic.name.removeprefix("chassis/") for o in simulation.outputs]
    assert order == ["imu", "scan", "pose", "jack", "battery", "contacts", "objects", "odometry"]
    again = zip(simulation.outputs, simulation.outputs, strict=True)
    assert all(one is other for one, other in again), "a step that is published again is the same"


KIND = BatteryKind(capacity=100, voltage_empty=20, voltage_full=30, idle=36, per_speed=36, jacking=72, charging=360)


def test_battery_pays_for_standing_driving_and_lifting() -> None:
    battery = BatteryModel(KIND, 0.5)
    battery.draw(speed=0.0, jacking=False, charging=False, dt=100)
    assert battery.percentage == pytest.approx(0.5 - 0.01)
    battery.draw(speed=-1.0, jacking=True, charging=False, dt=100)
    assert battery.percentage == pytest.approx(0.49 - 0.04)
    report = battery.report(0, charging=False)
    assert report.voltage == pytest.approx(24.5) and report.current == pytest.approx(144 / 24.5)


def test_battery_ends_at_full_and_at_empty() -> None:
    battery = BatteryModel(KIND, 0.99)
    battery.draw(0.0, False, True, 10_000)
    assert battery.percentage == 1.0 and battery.report(0, True).current < 0
    battery.draw(0.0, False, False, 1e6)
    assert battery.percentage == 0.0


def test_a_robot_on_its_dock_or_on_a_cable_is_charged() -> None:
    world = make_world(
        chargers={"dock": {"pose": (-0.6, 0, 0), "dock": (0, 0, 0)}},
    )
    docked = make_simulation(world)
    assert newest(docked, topics.BATTERY).charging and newest(docked, topics.CONTACTS).charge_contact
    before = docked.robots["amr1"].battery.percentage
    coast(docked, 0.5)
    assert docked.robots["amr1"].battery.percentage > before
    apart = make_simulation()
    assert not newest(apart, topics.BATTERY).charging
    inject(apart, "power_cable")
    coast(apart, 1.0)
    assert newest(apart, topics.BATTERY).charging and not newest(apart, topics.CONTACTS).charge_contact


def test_jack_takes_its_time_and_lifts_a_rack() -> None:
    world = make_world(
        rack_kinds={"heavy": {"size": (0.9, 0.9), "underside": 0.28, "height": 1.0, "mass": 300}},
        racks={"rack_1": {"kind": "heavy", "pose": (0, 0, 0)}},
    )
    simulation = make_simulation(world)
    rack = simulation.model.body("rack_1").id
    drive(simulation, 6.0, jack="up")
    half = newest(simulation, topics.JACK)
    assert half.state == "jacking_up" and half.progress == pytest.approx(6.0 / 11.8, abs=0.01)
    drive(simulation, 6.0, jack="up")
    up = newest(simulation, topics.JACK)
    assert up.state == "hold" and up.progress == 1.0
    assert up.weight == pytest.approx(300, rel=0.02)
    assert simulation.data.xpos[rack][2] == pytest.approx(0.08 - 0.035, abs=0.003)  # a gap of 35 mm comes first
    assert simulation.contact_log.count == 0, "lifting its rack is no collision"
    drive(simulation, 2.0, linear=0.3)
    assert simulation.data.xpos[rack][0] == pytest.approx(simulation.robots["amr1"].pose[0], abs=0.01)


def test_the_jack_stops_when_commands_stop() -> None:
    simulation = make_simulation()
    drive(simulation, 1.0, jack="up")
    coast(simulation, 0.4)
    first = newest(simulation, topics.JACK)
    coast(simulation, 0.2)
    assert first.state == "hold" and newest(simulation, topics.JACK).progress == first.progress > 0


@pytest.mark.parametrize(
    ("side", "yaw", "meets"),
    [
        ("back", 0.0, True),
        ("back", math.pi, False),
        ("front", math.pi, True),
        ("front", 0.0, False),
        ("none", 0.0, False),
    ],
)
def test_the_charge_contacts_are_at_the_side_that_the_profile_says(side: Any, yaw: float, meets: bool) -> None:
    world = make_world(
        robots={"amr1": {"profile": "longjack", "pose": (0, 0, yaw)}},
        chargers={"dock": {"pose": (-0.8, 0, 0), "dock": (0, 0, 0)}},
    )
    profile = load_profile("longjack").model_copy(update={"charge_contact": side})
    simulation = Simulation(world, {"amr1": profile}, 0, EXACT)
    assert newest(simulation, topics.CONTACTS).charge_contact is meets


def test_a_lidar_scans_at_the_rate_of_its_profile() -> None:
    profile = load_profile("longjack")
    fast = profile.model_copy(update={"lidar": profile.lidar.model_copy(update={"rate": 25.0})})
    for described, scans in ((profile, 25), (fast, 50)):
        simulation = Simulation(make_world(), {"amr1": described}, 0, EXACT)
        assert sum(topic is topics.SCAN for topic, _ in coast(simulation, 2.0)) == scans


def test_only_a_chassis_with_a_jack_publishes_one() -> None:
    jackal = make_simulation(make_world(robots={"amr1": {"profile": "jackal", "pose": (0, 0, 0)}}))
    assert topics.JACK not in [topic for topic, _ in coast(jackal, 1.0)]
    assert topics.JACK in [topic for topic, _ in coast(make_simulation(), 1.0)]
