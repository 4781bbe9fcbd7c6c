"""People, placed things, and the contact_log of contacts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.refusal import RequestRefused
from rackhand.schemas.world import MoveRobot, Place, Remove
from rackhand.services.sim.actors.walkers import Walker, is_in_way, make_route
from rackhand.services.sim.mjcf.scene import SLOTS
from tests.sim.helpers import coast, drive, make_simulation, make_world, newest

SQUARE = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
RACK = {"standard": {"size": (0.83, 0.83), "underside": 0.28, "height": 1.4, "mass": 90}}


def place(name: str = "crate", x: float = 2.0, y: float = 0.0, **rest: Any) -> Place:
    return Place.model_validate({"name": name, "pose": Pose2(x=x, y=y, yaw=0.0)} | rest)


def where(simulation: Any, name: str) -> tuple[float, float, float]:
    return next(tuple(thing.position) for thing in simulation.objects().objects if thing.name == name)


# -- walkers -----------------------------------------------------------------------------------------------------------


def test_a_walker_comes_round_and_rests_at_each_point() -> None:
    walker = Walker(make_route(SQUARE, speed=1.0, wait=0.5))
    assert walker.after(1.0).pose == pytest.approx((1.0, 0.0, 0.0))
    assert walker.after(2.3).pose == pytest.approx((2.0, 0.0, math.pi / 2))
    assert walker.after(3.5).pose == pytest.approx((2.0, 1.0, math.pi / 2))
    assert walker.after(10.0).after(1.0).pose == pytest.approx(walker.after(1.0).pose)


def test_many_short_times_are_one_long_time() -> None:
    route = make_route(SQUARE, speed=0.9, wait=0.3)
    stepped = Walker(route)
    for _ in range(500):
        stepped = stepped.after(0.02)
    assert stepped.pose == pytest.approx(Walker(route).after(10.0).pose, abs=1e-9)


@pytest.mark.parametrize(
    ("points", "speed"),
    [([(0, 0)], 1.0), ([(0, 0), (0, 0)], 1.0), (SQUARE, 0.0), (SQUARE, 1e9), ([(0, 0), (0, 1e-300)], 1)],
)
def test_a_walk_that_cannot_be_walked_is_refused(points: Any, speed: float) -> None:
    with pytest.raises(ValueError, match="a walk needs"):
        make_route(points, speed)


@pytest.mark.parametrize(
    ("robot", "in_way"),
    [
        ((1.0, 0.0, 0.0), True),
        ((1.2, 0.0, 0.0), False),
        ((1.2, 0.0, 0.0 + math.pi / 2), False),
        ((0.0, 0.7, math.pi / 2), False),
        ((0.8, 0.6, math.pi / 2), True),
        ((-0.9, 0.0, 0.0), False),
    ],
)
def test_a_robot_close_in_front_is_in_the_way(robot: tuple[float, float, float], in_way: bool) -> None:
    """Seen from a person of radius 0.25 m who looks along +x; the robot is 0.75 × 0.46 m."""
    assert is_in_way((0.0, 0.0, 0.0), 0.25, robot, 0.375, 0.23) is in_way


def test_a_person_stops_before_a_standing_robot_and_goes_on_when_it_is_gone() -> None:
    walk = {"kind": "walk", "points": [(-4.0, 0.0), (4.0, 0.0)], "speed": 1.0}
    simulation = make_simulation(make_world(movers={"anna": {"motion": walk}}))
    drive(simulation, 4.0)
    assert where(simulation, "anna")[0] == pytest.approx(-0.375 - 0.25 - 0.5, abs=0.03)
    assert simulation.contact_log.count == 0
    simulation.change(MoveRobot(robot="amr1", pose=Pose2(x=0.0, y=5.0, yaw=0.0)))
    drive(simulation, 2.0)
    assert where(simulation, "anna")[0] == pytest.approx(-1.125 + 2.0, abs=0.03)


def test_a_person_placed_at_run_time_walks_through_its_points() -> None:
    simulation = make_simulation()
    walk = (Pose2(x=4.0, y=3.0, yaw=0.0),)
    simulation.change(place("ben", x=2.0, y=3.0, kind="person", walk=walk, speed=1.0))
    coast(simulation, 1.0)
    assert where(simulation, "ben") == pytest.approx((3.0, 3.0, 0.875), abs=1e-6)


# -- placing -----------------------------------------------------------------------------------------------------------


def test_place_move_and_remove() -> None:
    simulation = make_simulation()
    simulation.change(place())
    assert where(simulation, "crate") == pytest.approx((2.0, 0.0, 0.2))
    simulation.change(place(y=3.0))
    assert where(simulation, "crate") == pytest.approx((2.0, 3.0, 0.2))
    assert sum(thing.name == "crate" for thing in simulation.objects().objects) == 1
    simulation.change(place(y=3.0, kind="cylinder", size=(0.3, 1.0)))
    geoms = [g for g in simulation.scene().geoms if g.body == "crate"]
    assert [(g.shape, g.size[:2]) for g in geoms] == [("cylinder", (0.3, 0.5))]
    simulation.change(Remove(name="crate"))
    assert not [g for g in simulation.scene().geoms if g.body == "crate"]
    with pytest.raises(RequestRefused, match="'crate' is not known; known: \\[\\]"):
        simulation.change(Remove(name="crate"))


def test_a_removed_thing_is_neither_seen_nor_touched() -> None:
    simulation = make_simulation()
    simulation.change(place(x=1.0))
    simulation.change(Remove(name="crate"))
    coast(simulation, 0.08)
    assert np.isposinf(newest(simulation, topics.SCAN).ranges).all()
    drive(simulation, 3.0, linear=1.0)
    assert simulation.contact_log.count == 0 and simulation.robots["amr1"].pose[0] > 2.0


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        (place(x=0.2), "'crate' would overlap 'amr1'"),
        (place("amr1"), "is already used"),
        (place("wall"), "is already used"),
        (place("a/b"), "want 1 … 60 letters"),
        (place(""), "want 1 … 60 letters"),
        (place(x=1e300), "want x, y and yaw within"),
        (place(size=(0.3, 1.0)), "want l, w, h"),
        (place(kind="cylinder", size=(0.3, 0.3, 1.0)), "want radius, height"),
        (place(size=(0.3, 0.3, 0.0)), "each 0.01 … 20 m"),
        (place(kind="person", size=(0.5, 0.9)), "must be higher"),
        (place(walk=(Pose2(x=5.0, y=5.0, yaw=0.0),)), "speed above 0"),
    ],
)
def test_what_cannot_be_placed_is_refused_and_changes_nothing(request_: Place, why: str) -> None:
    simulation = make_simulation(make_world(statics={"wall": {"kind": "wall", "start": (9, -9), "end": (9, 9)}}))
    before = simulation.objects()
    with pytest.raises(RequestRefused, match=why):
        simulation.change(request_)
    assert simulation.objects() == before


def test_a_refused_move_leaves_the_thing_where_it_was() -> None:
    simulation = make_simulation()
    simulation.change(place(size=(0.5, 0.6, 0.7)))
    with pytest.raises(RequestRefused, match="would overlap 'amr1'"):
        simulation.change(place(x=0.1, size=(0.2, 0.2, 0.2)))
    assert where(simulation, "crate") == pytest.approx((2.0, 0.0, 0.35))


def test_when_all_slots_are_taken_it_says_so() -> None:
    simulation = make_simulation()
    for i in range(SLOTS["person"]):
        simulation.change(place(f"p{i}", x=3.0, y=float(i), kind="person"))
    with pytest.raises(RequestRefused, match="all 8 slots for obstacles of kind person are in use"):
        simulation.change(place("one_more", x=5.0, kind="person"))
    simulation.change(Remove(name="p3"))
    simulation.change(place("one_more", x=5.0, kind="person"))


def test_a_robot_is_not_set_down_in_anything() -> None:
    simulation = make_simulation(make_world(statics={"wall": {"kind": "wall", "start": (3, -9), "end": (3, 9)}}))
    with pytest.raises(RequestRefused, match="'amr1' would overlap 'wall'"):
        simulation.change(MoveRobot(robot="amr1", pose=Pose2(x=2.6, y=0.0, yaw=0.0)))
    with pytest.raises(RequestRefused, match="robot 'amr9' is not known; known: \\['amr1'\\]"):
        simulation.change(MoveRobot(robot="amr9", pose=Pose2(x=0.0, y=0.0, yaw=0.0)))
    assert simulation.robots["amr1"].pose == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


# -- contacts ----------------------------------------------------------------------------------------------------------


def test_driving_about_touches_nothing() -> None:
    simulation = make_simulation()
    drive(simulation, 2.0, linear=1.0, angular=0.5)
    assert simulation.contact_log.count == 0


def test_a_crash_is_one_contact_with_name_time_and_force_and_closes_the_bumper() -> None:
    simulation = make_simulation(make_world(statics={"wall": {"kind": "wall", "start": (1.1, -9), "end": (1.1, 9)}}))
    heard = drive(simulation, 2.5, linear=0.6)
    assert simulation.contact_log.count == 1
    contact = simulation.contact_log.rows[0]
    assert (contact.robot, contact.other) == ("amr1", "wall")
    # 0.625 m away; 0.6 m/s is reached after 0.4 s and 0.12 m.
    assert contact.stamp == pytest.approx((0.4 + 0.505 / 0.6) * 1e9, rel=0.03)
    assert contact.force > 100
    bumped = [m for t, m in heard if t is topics.CONTACTS and m.bumper_front]
    assert bumped and bumped[0].stamp - contact.stamp <= 100_000_000
    assert not any(m.bumper_rear for t, m in heard if t is topics.CONTACTS)


def test_backing_into_a_crate_closes_the_rear_bumper() -> None:
    simulation = make_simulation()
    simulation.change(place(x=-0.8))
    heard = drive(simulation, 1.5, linear=-0.5)
    assert [c.other for c in simulation.contact_log.rows] == ["crate"]
    assert any(m.bumper_rear for t, m in heard if t is topics.CONTACTS)


def test_touching_again_after_parting_is_another_contact() -> None:
    simulation = make_simulation()
    simulation.change(place(x=0.8))
    for _ in range(2):
        drive(simulation, 1.5, linear=0.4)
        drive(simulation, 1.0, linear=-0.4)
    assert simulation.contact_log.count == 2


def test_the_force_of_a_contact_is_the_greatest_it_had() -> None:
    simulation = make_simulation(make_world(statics={"wall": {"kind": "wall", "start": (1.1, -9), "end": (1.1, 9)}}))
    while not simulation.contact_log.count:
        drive(simulation, 0.02, linear=0.1)
    softly = simulation.contact_log.rows[0].force
    drive(simulation, 1.0, linear=1.2)
    assert simulation.contact_log.count == 1
    assert simulation.contact_log.rows[0].force > 1.5 * softly


@pytest.mark.parametrize("size", [(0.2, 8.0, 0.5), (0.2, 8.0, 8.0)])
def test_a_long_thing_is_solid_to_its_ends(size: tuple[float, ...]) -> None:
    simulation = make_simulation()
    simulation.change(place("beam", x=1.0, y=3.7, size=size))
    drive(simulation, 1.5, linear=0.8)
    assert [c.other for c in simulation.contact_log.rows] == ["beam"]


def test_a_person_who_is_run_into_counts() -> None:
    simulation = make_simulation()
    simulation.change(place("ben", x=1.0, kind="person"))
    drive(simulation, 1.5, linear=0.8)
    assert [c.other for c in simulation.contact_log.rows] == ["ben"]


def test_two_robots_that_collide_both_count() -> None:
    robots = {n: {"profile": "longjack", "pose": (x, 0, 0)} for n, x in (("amr1", 0.0), ("amr2", 1.0))}
    simulation = make_simulation(make_world(robots=robots))
    drive(simulation, 1.5, linear=0.6)
    assert {(c.robot, c.other) for c in simulation.contact_log.rows} == {("amr1", "amr2"), ("amr2", "amr1")}


def test_a_rack_sleeps_until_it_is_run_into() -> None:
    world = make_world(rack_kinds=RACK, racks={"rack_1": {"kind": "standard", "pose": (1.2, 0.3, 0)}})
    simulation = make_simulation(world)
    coast(simulation, 0.2)
    tree = simulation.model.body_treeid[simulation.model.body("rack_1").id]
    assert simulation.data.tree_asleep[tree] >= 0
    drive(simulation, 2.0, linear=0.8)
    assert simulation.data.tree_asleep[tree] < 0
    assert [c.other for c in simulation.contact_log.rows][:1] == ["rack_1"]
    assert where(simulation, "rack_1")[0] > 1.21, "it was pushed"


def test_a_robot_passes_under_a_rack_without_touching_it() -> None:
    world = make_world(rack_kinds=RACK, racks={"rack_1": {"kind": "standard", "pose": (1.5, 0.0, 0)}})
    simulation = make_simulation(world)
    drive(simulation, 4.0, linear=0.8)
    assert simulation.robots["amr1"].pose[0] > 2.5 and simulation.contact_log.count == 0


def test_touches_have_names_and_times_and_an_obstacle_that_replaces_another_has_its_own() -> None:
    simulation = make_simulation()
    simulation.change(place("crate", x=0.8))
    drive(simulation, 1.0, linear=0.5)
    drive(simulation, 1.0, linear=-0.5)
    first = {touch.parts: touch for touch in simulation.touch_log.rows}
    assert set(first) == {("amr1/hull", "crate"), ("amr1/wheels", "floor")}
    hit, stood = first["amr1/hull", "crate"], first["amr1/wheels", "floor"]
    assert 0 < hit.first <= hit.last < 1.3e9 and (stood.first, stood.last) == (0, simulation.stamp - 2_000_000)
    simulation.change(Remove(name="crate"))
    simulation.change(place("box", x=0.8))
    drive(simulation, 2.0, linear=0.5)
    again = {touch.parts: touch for touch in simulation.touch_log.rows}
    assert again["amr1/hull", "crate"] == hit and again["amr1/hull", "box"].first > hit.last
