"""A chassis that carries a rack: it neither loses nor shifts it, and stops as it foresees."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import SetEmergencyStop
from rackhand.schemas.planar import PlanarPose, between
from rackhand.schemas.world import Place
from rackhand.worlds.world_model import Item, World
from tests.joined.chassis import JoinedChassis
from tests.joined.racks import hall_with_racks, lift
from tests.joined.world import JoinedWorld

# A course of some 20 m with four turns about the middle of the hall.
COURSE = ((3.0, 0.0, None), (3.0, 3.0, None), (-2.0, 3.0, math.pi), (-2.0, -1.0, None), (2.0, -1.0, 0.0))
SLIDE_PER_METRE = 0.005 / 40


def heavy(kind: str, goods: float) -> World:
    """A rack of that kind in the empty hall, with a box of ``goods`` kilograms on its top."""
    world = hall_with_racks(rack=(kind, 0.0, 0.0, 0.0))
    box = Item(size=(0.6, 0.6, 0.5), pose=(0, 0, 0), lies_on="rack", mass=goods)
    return world.model_copy(update={"items": {"box": box}, "movers": {}})


def on_plate(world: JoinedWorld) -> PlanarPose:
    chassis, rack = world.true_pose("amr1"), world.true_pose("rack")
    return between((chassis.x, chassis.y, chassis.yaw), (rack.x, rack.y, rack.yaw))


def lifted(world: JoinedWorld) -> tuple[JoinedChassis, PlanarPose]:
    """The chassis with the rack on its jack, and where that is on the plate. Velocities are not lowered for the weight:
    what follows is harder than it would be."""
    driver = world.chassis()
    lift(driver, "rack")
    driver.set_parameters(weight_based_speed_limit=False)
    return driver, on_plate(world)


def speed(driver: JoinedChassis) -> float:
    return driver.odometry[-1].twist.linear


def reach_full_speed(driver: JoinedChassis) -> None:
    driver.post(type="standard", target_x=6.0, target_y=0.0)
    driver.world.wait_for(lambda: True if speed(driver) > 1.0 else None, "full speed", 30.0, step=0.04)


@pytest.mark.parametrize(("kind", "goods"), [("standard", 210.0), ("large", 120.0)])
def test_a_rack_of_300_kg_does_not_slide_on_a_course_at_full_speed(tmp_path: Path, kind: str, goods: float) -> None:
    with JoinedWorld(heavy(kind, goods), tmp_path, with_arms=False) as world:
        driver, before = lifted(world)
        begun, fastest, way = world.now(), 0.0, 0.0
        for x, y, yaw in COURSE:
            target = {"target_x": x, "target_y": y} | ({} if yaw is None else {"target_ori": yaw})
            move = driver.drive(type="standard", **target)
            assert move.state == "succeeded", move
        for odometry in driver.odometry:
            if odometry.stamp > begun * 1e9:
                fastest = max(fastest, abs(odometry.twist.linear))
                way += abs(odometry.twist.linear) * 0.02
        after = on_plate(world)
        slid = math.hypot(after[0] - before[0], after[1] - before[1])
        print(f"{kind} with {goods:g} kg: {way:.1f} m at up to {fastest:.2f} m/s, slid {slid * 1e3:.2f} mm")
        assert way > 15 and fastest > 0.9, "it is a course at full speed"
        assert slid < SLIDE_PER_METRE * way and abs(after[2] - before[2]) < 0.005
        allowed = {("amr1/jack", "rack"), ("amr1/wheels", "floor"), ("box", "rack")}
        assert {t.parts for t in world.inspect().touches if t.last > begun * 1e9} == allowed


def test_a_crate_that_appears_ahead_of_a_heavy_rack_stops_it_in_time(tmp_path: Path) -> None:
    """0.75 m ahead at 1 m/s, little more than a stop is long: it is as long as was foreseen, and the rack stays."""
    with JoinedWorld(heavy("standard", 210.0), tmp_path, with_arms=False) as world:
        driver, before = lifted(world)
        reach_full_speed(driver)
        x = world.true_pose("amr1").x
        world.ask(Place(name="crate", pose=Pose2(x=x + 0.47 + 0.2 + 0.75, y=0.0, yaw=0.0), size=(0.4, 0.6, 0.6)))
        world.wait_for(lambda: True if speed(driver) < 0.02 else None, "it stands", 10.0, step=0.04)
        world.advance(0.5)
        way = world.true_pose("amr1").x - x
        assert 0.4 < way < 0.75
        touches = {touch.parts for touch in world.inspect().touches}
        assert not any("crate" in parts for parts in touches)
        assert math.dist(on_plate(world)[:2], before[:2]) < 0.002


def test_an_emergency_stop_keeps_the_rack_on_the_jack(tmp_path: Path) -> None:
    with JoinedWorld(heavy("standard", 210.0), tmp_path, with_arms=False) as world:
        driver, before = lifted(world)
        reach_full_speed(driver)
        x, v = world.true_pose("amr1").x, speed(driver)
        driver.ask(SetEmergencyStop(enable=True))
        world.advance(2.0)
        way = world.true_pose("amr1").x - x
        assert abs(speed(driver)) < 0.01
        assert v * v / (2 * 1.2) < way < v * v / (2 * 1.2) + 0.2 * v, "braked with what a load allows, not harder"
        assert math.dist(on_plate(world)[:2], before[:2]) < 0.002
