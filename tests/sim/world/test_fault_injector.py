"""Each fault by what it does to the world and to what is measured in it, and that it is gone when it is cleared."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rackhand.schemas import topics
from rackhand.schemas.faults import FAULTS, amount_of
from rackhand.schemas.refusal import RequestRefused
from rackhand.schemas.world import InjectFault
from rackhand.services.sim.simulation import Simulation
from tests.sim.helpers import coast, drive, make_simulation, make_world, newest

KINDS = {"standard": {"size": (0.8, 0.8), "underside": 0.28, "height": 1.4, "mass": 90}}
Pose = tuple[float, float, float]


@pytest.fixture
def simulation() -> Simulation:
    """A chassis at the origin, before it a rack 2 m away, behind it a charger, to its left a wall of glass to be."""
    return make_simulation(
        make_world(
            rack_kinds=KINDS,
            racks={"rack_1": {"kind": "standard", "pose": (2.0, 0.0, 0.0)}},
            chargers={"charger_1": {"pose": (-1.5, 0.0, 0.0), "dock": (-0.9, 0.0, 0.0)}},
            statics={"pane": {"kind": "box", "pose": (0, 2, 0), "size": (1, 0.1, 1)}},
        )
    )


def inject(simulation: Simulation, fault: str, target: str = "amr1", **more: Any) -> None:
    simulation.change(InjectFault.model_validate({"fault": fault, "target": target, **more}))


def at(pose: Pose) -> dict[str, float]:
    return dict(zip(("x", "y", "yaw"), pose, strict=True))


def hits(simulation: Simulation) -> np.ndarray[Any, Any]:
    """Where the next scan's beams end, in the chassis' frame: x, y of each that has an end."""
    coast(simulation, 0.1)
    while (scan := newest(simulation, topics.SCAN)) is None:
        simulation.step()
    angles = scan.sensor.yaw + scan.angle_min + scan.angle_step * np.arange(len(scan.ranges))
    seen = np.isfinite(scan.ranges)
    ranges, angles = scan.ranges[seen], angles[seen]
    return np.column_stack([scan.sensor.x + ranges * np.cos(angles), scan.sensor.y + ranges * np.sin(angles)])


def in_box(points: np.ndarray[Any, Any], x: float, y: float, half: float) -> int:
    return int((np.abs(points - (x, y)).max(axis=1) < half).sum())


def where(simulation: Simulation, name: str) -> tuple[float, float]:
    thing = next(thing for thing in simulation.objects().objects if thing.name == name)
    return thing.position[0], thing.position[1]


def test_a_noisy_lidar_measures_the_same_place_differently(simulation: Simulation) -> None:
    exact = hits(simulation)
    inject(simulation, "lidar_noisy", amount=0.2)
    noisy = hits(simulation)
    shorter = min(len(exact), len(noisy))
    assert np.std(np.linalg.norm(noisy[:shorter], axis=1) - np.linalg.norm(exact[:shorter], axis=1)) > 0.1
    inject(simulation, "lidar_noisy", active=False)
    assert hits(simulation) == pytest.approx(exact, abs=1e-3)


def test_slipping_wheels_turn_more_than_the_chassis_drives(simulation: Simulation) -> None:
    inject(simulation, "wheel_slip")
    drive(simulation, 2.0, linear=0.8)
    driven, measured = simulation.robots["amr1"].pose[0], newest(simulation, topics.ODOMETRY).pose.x
    assert measured > 0.8 and driven < 0.5 * measured
    inject(simulation, "wheel_slip", active=False)
    before, told = simulation.robots["amr1"].pose[0], newest(simulation, topics.ODOMETRY).pose.x
    drive(simulation, 1.0, linear=-0.1)
    coast(simulation, 1.0)
    assert simulation.robots["amr1"].pose[0] - before < 0.4 and told > 0.8


def test_a_tilted_chassis_measures_gravity_from_the_side(simulation: Simulation) -> None:
    inject(simulation, "tilted", amount=0.2)
    coast(simulation, 0.2)
    force = newest(simulation, topics.IMU).linear_acceleration
    assert force[1] == pytest.approx(9.81 * math.sin(0.2), abs=0.1)
    assert force[2] == pytest.approx(9.81 * math.cos(0.2), abs=0.1)


def test_a_critical_battery_is_as_it_was_when_it_is_cleared(simulation: Simulation) -> None:
    battery = simulation.robots["amr1"].battery
    inject(simulation, "battery_critical", amount=0.07)
    inject(simulation, "battery_critical", amount=0.03)
    assert battery.percentage == pytest.approx(0.03)
    inject(simulation, "battery_critical", active=False)
    assert battery.percentage == pytest.approx(0.5, abs=1e-3)


def test_a_kidnapped_chassis_is_elsewhere_and_its_odometry_is_not(simulation: Simulation) -> None:
    inject(simulation, "kidnapped", pose=at((-4.0, 3.0, 1.0)))
    coast(simulation, 0.1)
    assert simulation.robots["amr1"].pose == pytest.approx((-4.0, 3.0, 1.0), abs=0.01)
    assert newest(simulation, topics.ODOMETRY).pose.x == pytest.approx(0.0, abs=0.01)
    inject(simulation, "kidnapped", active=False)
    assert simulation.robots["amr1"].pose == pytest.approx((0.0, 0.0, 0.0), abs=0.01)


def test_a_missing_rack_comes_back(simulation: Simulation) -> None:
    inject(simulation, "rack_missing", "rack_1")
    assert in_box(hits(simulation), 2.0, 0.0, 0.6) == 0
    inject(simulation, "rack_missing", "rack_1", active=False)
    assert in_box(hits(simulation), 2.0, 0.0, 0.6) > 0


def test_a_rack_that_slid_slides_back(simulation: Simulation) -> None:
    inject(simulation, "rack_slid", "rack_1", pose=at((0.1, 0.2, 0.3)))
    assert where(simulation, "rack_1") == pytest.approx((2.1, 0.2), abs=1e-3)
    inject(simulation, "rack_slid", "rack_1", active=False)
    assert where(simulation, "rack_1") == pytest.approx((2.0, 0.0), abs=1e-3)


def test_the_lidar_sees_the_legs_of_a_resized_rack_where_they_are_now(simulation: Simulation) -> None:
    """The rays are culled by boxes that must have moved with the legs."""
    inject(simulation, "rack_resized", "rack_1", amount=0.8)
    half = 0.8 * (0.4 - 0.015)
    points = hits(simulation)
    assert in_box(points, 2.0 - half, half, 0.04) > 0 and in_box(points, 2.0 - half, -half, 0.04) > 0
    assert in_box(points, 2.0 - 0.385, 0.385, 0.03) == 0
    inject(simulation, "rack_resized", "rack_1", active=False)
    points = hits(simulation)
    assert in_box(points, 2.0 - 0.385, 0.385, 0.03) > 0 and in_box(points, 2.0 - half, half, 0.03) == 0


def test_a_moved_dock_is_seen_and_charges_where_it_is_now(simulation: Simulation) -> None:
    before = hits(simulation)
    assert in_box(before, -1.5, 0.0, 0.4) > 0
    inject(simulation, "dock_moved", "charger_1", pose=at((0.0, 1.0, 0.0)))
    after = hits(simulation)
    assert in_box(after, -1.5, 1.0, 0.4) > 0 and in_box(after, -1.5, 0.0, 0.3) == 0
    robot = simulation.robots["amr1"]
    inject(simulation, "kidnapped", pose=at((-0.9, 0.0, 0.0)))
    assert not robot.charge_contact
    inject(simulation, "kidnapped", pose=at((-0.9, 1.0, 0.0)))
    assert robot.charge_contact
    inject(simulation, "kidnapped", active=False)
    inject(simulation, "dock_moved", "charger_1", active=False)
    assert hits(simulation) == pytest.approx(before, abs=1e-2)


def test_a_turned_dock_turns_about_its_own_middle(simulation: Simulation) -> None:
    inject(simulation, "dock_moved", "charger_1", pose=at((0.0, 0.0, math.pi / 2)))
    assert simulation.robots["amr1"].dock_poses[0] == pytest.approx((-1.5, 0.6, math.pi / 2))


def test_glass_is_not_seen_and_still_there(simulation: Simulation) -> None:
    assert in_box(hits(simulation), 0.0, 1.95, 0.3) > 0
    inject(simulation, "glass", "pane")
    assert in_box(hits(simulation), 0.0, 1.95, 0.3) == 0
    inject(simulation, "kidnapped", pose=at((0.0, 1.0, math.pi / 2)))
    drive(simulation, 3.0, linear=0.5)
    assert {contact.other for contact in simulation.contact_log.rows} == {"pane"}
    inject(simulation, "glass", "pane", active=False)
    inject(simulation, "kidnapped", active=False)
    assert in_box(hits(simulation), 0.0, 1.95, 0.3) > 0


@pytest.mark.parametrize("fault", ["corridor_blocked", "person_standing"])
def test_what_is_in_the_way_goes_away(simulation: Simulation, fault: str) -> None:
    inject(simulation, fault, "bob", pose=at((-1.0, -2.0, 0.0)))
    assert in_box(hits(simulation), -1.0, -2.0, 0.5) > 0
    inject(simulation, fault, "bob", active=False)
    assert in_box(hits(simulation), -1.0, -2.0, 0.5) == 0


@pytest.mark.parametrize(
    ("fault", "target", "more", "text"),
    [
        ("lidar_dead", "amr2", {}, "robot"),
        ("rack_missing", "rack_9", {}, "rack"),
        ("dock_moved", "rack_1", {"pose": at((0, 0, 0))}, "charger"),
        ("glass", "nothing", {}, "thing"),
        ("leg_hidden", "rack_1", {"part": 4}, "has no part 4"),
        ("lidar_dead", "amr1", {"part": 0}, "has no part 0; it has none"),
        ("lidar_dead", "amr1", {"amount": 0.5}, "'lidar_dead' has no amount"),
        ("battery_critical", "amr1", {"amount": 1.5}, "want 0 … 1 (charge, 1 is full)"),
        ("kidnapped", "amr1", {}, "needs a pose: x, y (m) and yaw (rad) in the map"),
        ("lidar_dead", "amr1", {"pose": at((0, 0, 0))}, "takes no pose"),
        ("kidnapped", "amr1", {"pose": at((2.0, 0.4, 0))}, "would overlap"),
        ("kidnapped", "amr1", {"active": False}, "was not kidnapped"),
        ("rack_slid", "rack_1", {"active": False}, "did not slide"),
    ],
)
def test_what_cannot_be_is_refused(
    simulation: Simulation, fault: str, target: str, more: dict[str, Any], text: str
) -> None:
    with pytest.raises(RequestRefused) as refused:
        inject(simulation, fault, target, **more)
    assert text in refused.value.text
    assert not simulation.robots["amr1"].faults


@pytest.mark.parametrize("kind", FAULTS.values(), ids=lambda kind: kind.name)
def test_defaults_of_amounts_are_allowed(kind: Any) -> None:
    assert kind.amount is None or amount_of(kind, None) == kind.amount.default
    assert kind.text
