"""Racks on the floor as obstacles: found, kept while hidden, removed when they are gone, and never driven through."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from rackhand.schemas.base import Twist2
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.behaviors.base import Drive
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.load import Load, LoadState
from rackhand.services.planner.perception.racks import KnownRack
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import Hall, Plant, Robot, box, idle, overlap
from tests.planner.racks import LARGE, STANDARD, legs

PLACE = (4.0, 4.0, 0.0)


def rack_at(pose: Sequence[float], spec: RackSpec = STANDARD) -> list[np.ndarray]:
    return legs(spec, pose)


def outline(pose: Sequence[float], spec: RackSpec = STANDARD) -> np.ndarray:
    return se2.transformed(np.array(pose), spec.outline())


def known(robot: Robot) -> list[KnownRack]:
    return robot.costmap.racks.racks


@pytest.fixture
def beside(begin) -> tuple[Robot, Plant]:
    """A robot that has stood for 2 s before a rack at ``PLACE`` in a hall without anything else."""
    robot, plant = begin(Hall(10, 8), crates=rack_at(PLACE))
    idle(robot, plant, 2.0)
    return robot, plant


@pytest.mark.parametrize("spec", [STANDARD, LARGE], ids=("standard", "large"))
def test_a_rack_is_known_with_its_kind_and_pose(begin, spec: RackSpec) -> None:
    pose = (4.0, 4.5, 0.3)
    robot, plant = begin(Hall(10, 8), crates=rack_at(pose, spec))
    idle(robot, plant, 4.0)
    (rack,) = known(robot)
    assert rack.spec == spec
    assert np.hypot(*(rack.pose[:2] - pose[:2])) < 0.03
    turns = (rack.pose[2] - pose[2]) / (math.pi / 2 if spec == STANDARD else math.pi)
    assert abs(turns - round(turns)) < 0.03


def test_the_whole_outline_is_blocked_nearby_and_in_plans(beside) -> None:
    robot, _ = beside
    costmap = robot.costmap
    middle = costmap.near.geometry.cell(*PLACE[:2])
    assert costmap.near.distance[middle] == 0.0
    assert costmap.blocked()[costmap.static.geometry.cell(*PLACE[:2])]
    assert not costmap.static.blocked[costmap.static.geometry.cell(*PLACE[:2])]


def test_a_rack_in_a_gate_closes_it_though_the_body_would_fit_between_the_legs(begin) -> None:
    hall = Hall(10, 8, [box(4.0, 1.75, 0.2, 3.1), box(4.0, 5.75, 0.2, 2.1)])
    robot, plant = begin(hall, crates=rack_at(PLACE))
    idle(robot, plant, 2.0)
    robot.start(Goal(7.5, 4.0, 0.0))
    for _ in range(1500):
        told = robot.tick()
        plant.drive(told.twist)
        assert not overlap(plant.body(), outline(PLACE)), plant.pose
        if told.arrived:
            break
    assert told.arrived and plant.contacts == []


def test_the_guard_stops_a_remote_driver_before_the_gap_between_the_legs(beside) -> None:
    robot, plant = beside
    for _ in range(150):
        plant.drive(robot.want(Twist2(linear=0.5, angular=0.0)))
    assert plant.pose[0] > 2.8 and not overlap(plant.body(), outline(PLACE))


def test_a_behaviour_may_drive_under_it_where_it_says_so(beside) -> None:
    robot, plant = beside
    where = outline((PLACE[0] + 0.03, PLACE[1] - 0.02, 0.02))
    for _ in range(200):
        robot._measure()
        wanted = Drive(Twist2(linear=0.5, angular=0.0), may_touch=(where,))
        plant.drive(robot.motion.command(wanted, robot.state, robot.motion.settings.control))
    assert plant.pose[0] > PLACE[0] and plant.contacts == []


def test_a_masked_costmap_is_free_under_the_rack_and_only_there(begin) -> None:
    robot, plant = begin(Hall(10, 8), crates=rack_at(PLACE) + rack_at((4.0, 5.6, 0.0)))
    idle(robot, plant, 2.0)
    masked = robot.costmap.mask(outline((PLACE[0] + 0.03, PLACE[1] - 0.02, 0.02)))
    cell, other = masked.near.geometry.cell(*PLACE[:2]), masked.near.geometry.cell(4.0, 5.6)
    assert masked.near.distance[cell] > 0.3 and masked.near.distance[other] == 0.0
    flat = masked.static.geometry.cell(*PLACE[:2])
    assert not masked.blocked()[flat] and robot.costmap.blocked()[flat]


def test_one_that_is_gone_vanishes(beside) -> None:
    robot, plant = beside
    assert known(robot)
    plant.crates = []
    idle(robot, plant, 2.5)
    assert not known(robot)
    assert robot.costmap.near.distance[robot.costmap.near.geometry.cell(*PLACE[:2])] > 0.5


@pytest.mark.parametrize("shift", [0.04, 0.2, 0.6])
def test_one_that_was_moved_is_where_it_is_now(beside, shift: float) -> None:
    robot, plant = beside
    plant.crates = rack_at((PLACE[0], PLACE[1] + shift, 0.0))
    idle(robot, plant, 5.0)
    (rack,) = known(robot)
    assert rack.pose[:2] == pytest.approx((PLACE[0], PLACE[1] + shift), abs=0.02)


def test_one_behind_something_is_still_there(beside) -> None:
    robot, plant = beside
    plant.crates += [box(2.8, 4.0, 0.2, 2.5)]
    idle(robot, plant, 5.0)
    assert len(known(robot)) == 1


def test_it_is_forgotten_after_the_time_that_the_settings_say(begin) -> None:
    settings = NavigationSettings(rack_memory=3.0)
    robot, plant = begin(Hall(10, 8), crates=rack_at(PLACE), settings=settings)
    idle(robot, plant, 2.0)
    plant.crates += [box(2.8, 4.0, 0.2, 2.5)]
    idle(robot, plant, 2.0)
    assert known(robot)
    idle(robot, plant, 3.0)
    assert not known(robot)


def test_the_rack_above_the_chassis_does_not_block_and_is_known_at_once(begin) -> None:
    robot, plant = begin(Hall(10, 8), pose=PLACE, crates=rack_at(PLACE))
    robot.motion._take_load(Load.under(STANDARD, np.array(PLACE)))
    idle(robot, plant, 0.3)
    assert len(known(robot)) == 1 and robot.costmap.racks.blocking == []
    robot.motion._take_load(Load())
    idle(robot, plant, 0.3)
    assert len(robot.costmap.racks.blocking) == 1


def test_a_lifted_rack_leaves_nothing_where_it_was(begin) -> None:
    robot, plant = begin(Hall(10, 8), pose=PLACE, crates=rack_at(PLACE))
    robot.motion._take_load(Load.under(STANDARD, np.array(PLACE)))
    idle(robot, plant, 1.0)
    assert robot.costmap.observed.occupied().any(), "its legs, while it is on the floor"
    robot.motion._take_load(Load(state=LoadState.CARRYING, spec=STANDARD, rack_pose=(0.0, 0.0, 0.0)))
    idle(robot, plant, 1.0)
    assert not robot.costmap.observed.occupied().any() and not known(robot)


def test_other_rectangles_of_posts_are_no_racks(begin) -> None:
    robot, plant = begin(Hall(10, 8), crates=rack_at(PLACE, RackSpec(width=0.7, depth=0.7)))
    idle(robot, plant, 3.0)
    assert not known(robot)


HIDES_THE_BACK = box(4.15, 4.0, 0.1, 1.4)  # from a chassis on the left: the two legs behind it


def shown(begin, registered: Sequence[float] | None, crates: list[np.ndarray]) -> list[KnownRack]:
    """What is known after 3 s with a rack point there (m, m, degrees)."""
    hall = Hall(10, 8)
    if registered is not None:
        geometry = {"type": "Point", "coordinates": list(registered[:2])}
        properties = {"type": "34", "name": "a", "yaw": registered[2]}
        hall.overlays = [{"type": "Feature", "id": "a", "geometry": geometry, "properties": properties}]
    robot, plant = begin(hall, pose=(1.5, 4.0, 0.0), crates=crates)
    idle(robot, plant, 3.0)
    return known(robot)


def test_two_legs_at_a_registered_point_are_a_rack_while_the_others_are_hidden(begin) -> None:
    (rack,) = shown(begin, (4.05, 3.97, 3.0), [*rack_at(PLACE), HIDES_THE_BACK])
    assert rack.pose == pytest.approx(PLACE, abs=0.03)
    assert rack.spec == STANDARD


def test_two_legs_elsewhere_are_none(begin) -> None:
    assert not shown(begin, None, [*rack_at(PLACE), HIDES_THE_BACK])
    assert not shown(begin, (4.0, 4.3, 0.0), [*rack_at(PLACE), HIDES_THE_BACK])


def test_two_posts_at_a_registered_point_are_none_where_the_other_legs_are_seen_to_be_missing(begin) -> None:
    posts = [leg for leg in rack_at(PLACE) if leg[:, 0].mean() < PLACE[0]]
    assert len(posts) == 2 and not shown(begin, PLACE, posts)
