"""What scans show of a lift: doorway, doors and the place in the cabin, in a hall of the plant."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.services.planner.map.grid import load_map
from rackhand.services.planner.perception.lift_view import (
    DoorWatch,
    Doorway,
    doorway_in_sight,
    find_doorway,
    is_in_lift,
    lift_at,
    point_state,
    whereabouts,
    with_doors,
)
from tests.planner.map.test_grid import feature
from tests.planner.plant import BODY, Array, Hall, Plant, Robot, Walker, box, idle

# A cabin of 2 x 2 m at the right wall, x 7.8 to 9.8; its door, 1.4 m wide, is at x 7.7.
CABIN = [[[7.8, 3.0], [9.8, 3.0], [9.8, 5.0], [7.8, 5.0]]]
SHAFT = [box(7.7, 3.1, 0.15, 0.4), box(7.7, 4.9, 0.15, 0.4), box(8.7, 2.85, 2.1, 0.2), box(8.7, 5.15, 2.1, 0.2)]
PLACE = np.array([8.9, 4.0, 0.0])
AHEAD = np.array([(x, 4.0, 0.0) for x in np.arange(6.0, 8.95, 0.05)])


def hall() -> Hall:
    return Hall(10, 8, SHAFT, [feature("Polygon", CABIN, regionType=3, name="lift")])


def seen(x: float = 6.3, crates: tuple[Array, ...] = (), walkers: tuple[Walker, ...] = (), **faults: Any) -> Robot:
    """A robot before the lift that has looked for two seconds."""
    plant = Plant(hall(), (x, 4.0, 0.0), seed=1)
    plant.crates, plant.walkers = list(crates), list(walkers)
    for name, value in faults.items():
        setattr(plant, name, value)
    robot = Robot(plant)
    idle(robot, plant, 2.0)
    return robot


def person(x: float, y: float) -> Walker:
    return Walker(np.array([(x, y), (x, y)]), 0.0)


def body_at(x: float, y: float) -> Array:
    moved: Array = BODY + np.array([x, y])
    return moved


def leaves(opening: float) -> tuple[Array, ...]:
    """The two leaves of the door, open by a share."""
    half = 0.7 * (1.0 - opening)
    return tuple(box(7.7, 4.0 + side * (0.7 - half / 2), 0.05, half) for side in (-1, 1))


def doorway(robot: Robot) -> Doorway:
    static = robot.costmap.static
    zone = lift_at(static.overlays, PLACE[0], PLACE[1])
    assert zone is not None
    found = find_doorway(static, zone, AHEAD)
    assert found is not None
    return found


def state(robot: Robot, place: Array = PLACE) -> str:
    found, chassis = robot.motion.perception.seen, robot.motion.perception.pose
    assert found is not None and chassis is not None and robot.motion.footprint is not None
    return point_state(robot.costmap, found, chassis, robot.motion.footprint, place)


def test_the_doorway_is_where_the_path_crosses_and_as_wide_as_the_map_has_it() -> None:
    found = doorway(seen())
    assert found.middle == pytest.approx((7.8, 4.0), abs=0.06)
    assert found.into == pytest.approx((1.0, 0.0)) and found.left == pytest.approx(0.7, abs=0.05)
    assert found.right == pytest.approx(0.7, abs=0.05)
    static = load_map(hall().map(), 0.4)
    zone = lift_at(static.overlays, 8.9, 4.0)
    assert zone is not None and lift_at(static.overlays, 7.0, 4.0) is None
    assert find_doorway(static, zone, AHEAD[:10]) is None
    back = find_doorway(static, zone, np.array([(8.9, 4.0, 0.0), (7.0, 4.0, 0.0), (7.9, 4.2, 0.0)]))
    assert back is not None and back.into == pytest.approx((1.0, 0.0)), "out and in again: it is entered there"


def test_without_a_path_the_doorway_is_on_the_straight_line_to_a_place_that_no_wall_hides() -> None:
    static = load_map(hall().map(), 0.4)
    zone = lift_at(static.overlays, PLACE[0], PLACE[1])
    assert zone is not None
    found = doorway_in_sight(static, zone, np.array([6.3, 4.2]), PLACE[:2])
    assert found is not None
    assert found.middle == pytest.approx((7.8, 4.08), abs=0.06)
    assert found.into == pytest.approx((1.0, 0.0)) and found.left + found.right == pytest.approx(1.4, abs=0.1)
    assert doorway_in_sight(static, zone, np.array([6.3, 1.0]), PLACE[:2]) is None, "the shaft is between"


@pytest.mark.parametrize(("opening", "covered", "closed"), [(0.0, 1.0, True), (0.3, 0.7, True), (0.6, 0.4, False)])
def test_leaves_of_a_door_cover_the_doorway(opening: float, covered: float, closed: bool) -> None:
    robot = seen(crates=leaves(opening))
    share = doorway(robot).covered(robot.costmap.observed.points)
    assert share == pytest.approx(covered, abs=0.16)
    watch = DoorWatch()
    watch.take(0, share)
    assert watch.is_closed is closed and not watch.is_closing


def test_a_person_in_the_doorway_is_no_door() -> None:
    for y in (3.6, 4.0, 4.3):
        robot = seen(walkers=(person(7.7, y),))
        watch = DoorWatch()
        watch.take(0, doorway(robot).covered(robot.costmap.observed.points))
        assert not watch.is_closed


def test_a_door_is_closing_while_it_covers_more_and_more() -> None:
    watch, closing = DoorWatch(), []
    for k, covered in enumerate((0.0, 0.03, 0.05, 0.08, 0.12, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.05)):
        watch.take(k * 80_000_000, covered)
        watch.take(k * 80_000_000, 1.0)  # the same scan again
        closing.append(watch.is_closing)
    assert closing == [False] * 4 + [True] * 4 + [False] * 5


@pytest.mark.parametrize(
    ("there", "expected"),
    [
        ({}, "free"),
        ({"walkers": (person(8.9, 4.0),)}, "occupied"),
        ({"crates": (box(8.9, 4.1, 0.3, 0.3),)}, "occupied"),
        ({"crates": (box(7.2, 4.0, 0.2, 1.2),)}, "obscured"),
        ({"crates": leaves(0.0)}, "obscured"),
        ({"walkers": (person(8.3, 4.8),)}, "free"),
    ],
    ids=["nothing", "person", "crate", "crate before the door", "closed door", "person beside"],
)
def test_the_place_in_the_cabin(there: dict[str, Any], expected: str) -> None:
    assert state(seen(**there)) == expected


def test_a_place_behind_a_mapped_wall_is_unknown() -> None:
    assert state(seen(2.0), np.array([9.3, 4.7, 0.0])) == "free", "in sight from far before it"
    aside = Plant(hall(), (6.9, 2.0, 0.0), seed=1)
    robot = Robot(aside)
    idle(robot, aside, 2.0)
    assert state(robot, np.array([8.4, 3.4, 0.0])) == "unknown"


def test_the_place_is_free_under_the_chassis_itself() -> None:
    assert state(seen(8.6)) == "free"


def test_whole_body_in_the_cabin_or_not() -> None:
    overlays = load_map(hall().map(), 0.4).overlays
    zone = overlays.zones[0]
    for x, where in ((7.0, "outside"), (7.6, "in_doorway"), (8.1, "in_doorway"), (8.3, "inside")):
        body = body_at(x, 4.0)
        assert (whereabouts(zone, body), is_in_lift(overlays, body)) == (where, where == "inside")
    assert with_doors(zone).min(axis=0) == pytest.approx((7.45, 2.65))


def test_before_the_doorway_and_between_the_doors() -> None:
    found = doorway(seen())
    assert found.is_before(np.array([6.0, 4.5])) and not found.is_before(np.array([6.0, 4.9]))
    assert not found.has_begun(body_at(7.2, 4.0)) and found.has_begun(body_at(7.3, 4.0))
    assert not found.has_begun(body_at(7.3, 5.6)), "behind the wall beside it"
