"""Occupancy of the rack points of a map, judged from ray-cast scans."""

from __future__ import annotations

import pytest

from rackhand.services.planner.load import Load, LoadState
from rackhand.services.planner.perception.rack_points import RackPoints, largest_outline
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import Hall, Robot, Walker, box, idle
from tests.planner.racks import LARGE, STANDARD, legs

PLACES = {"a": (4.0, 4.0, 0.0), "b": (4.0, 6.0, 90.0), "far": (8.5, 6.5, 0.0)}


def point(name: str, x: float, y: float, degrees: float) -> dict:
    properties = {"type": 34, "name": name, "yaw": degrees}
    geometry = {"type": "Point", "coordinates": [x, y]}
    return {"type": "Feature", "id": name, "geometry": geometry, "properties": properties}


def hall(*mapped) -> Hall:
    return Hall(10, 8, list(mapped), [point(name, *place) for name, place in PLACES.items()])


def points(robot: Robot) -> RackPoints:
    return robot.costmap.rack_points


def states(robot: Robot) -> list[str]:
    return [points(robot).state(name) for name in PLACES]


def test_empty_points_in_view_are_free_and_those_out_of_reach_unknown(begin) -> None:
    robot, plant = begin(hall())
    idle(robot, plant, 2.5)
    assert states(robot) == ["free", "free", "unknown"]
    seen = points(robot).detected(plant.stamp, "hall")
    assert [row.poi_id for row in seen.racks] == ["a", "b"] and seen.map_uid == "hall"
    remembered = points(robot).remembered(plant.stamp, "hall")
    assert [row.levels[0].state for row in remembered.racks] == ["free", "free", "unknown"]
    assert 0 < plant.stamp - remembered.racks[0].levels[0].stamp < 1e9


@pytest.mark.parametrize(
    "things",
    [legs(STANDARD, (4.04, 3.97, 0.05)), legs(LARGE, (4.0, 4.0, 0.0)), [box(4.2, 4.3, 0.3, 0.2)]],
    ids=("standard rack", "large rack", "crate"),
)
def test_a_rack_or_anything_solid_occupies_a_point_until_it_is_gone(begin, things) -> None:
    robot, plant = begin(hall(), crates=things)
    idle(robot, plant, 2.5)
    assert states(robot)[:2] == ["occupied", "free"]
    plant.crates = []
    idle(robot, plant, 4.0)
    assert states(robot)[:2] == ["free", "free"]


def test_a_rack_of_a_kind_that_is_not_known_occupies_a_point_too(begin) -> None:
    robot, plant = begin(hall(), crates=legs(STANDARD.model_copy(update={"width": 0.6, "depth": 0.6}), PLACES["a"]))
    idle(robot, plant, 2.5)
    assert states(robot)[0] == "occupied"


def test_what_stands_beside_a_point_does_not_occupy_it(begin) -> None:
    robot, plant = begin(hall(), crates=[box(4.0, 5.0, 0.4, 0.3), *legs(STANDARD, (5.3, 4.0, 0.0))])
    idle(robot, plant, 2.5)
    assert states(robot)[0] == "free"


def test_a_point_behind_something_is_not_judged(begin) -> None:
    robot, plant = begin(hall(box(2.6, 4.0, 0.2, 3.0)))
    idle(robot, plant, 2.5)
    assert states(robot)[0] == "unknown"


def test_a_wall_of_the_map_beside_a_point_does_not_occupy_it(begin) -> None:
    robot, plant = begin(hall(box(4.7, 4.0, 0.1, 1.2)))
    idle(robot, plant, 2.5)
    assert states(robot)[0] == "free"


def test_somebody_who_walks_through_occupies_it_for_that_time(begin) -> None:
    robot, plant = begin(hall(), walkers=(Walker([(4.0, 2.5), (4.0, 5.4)], 0.4),))
    seen = set()
    for _ in range(20):
        idle(robot, plant, 0.5)
        seen.add(points(robot).seen_now("a"))
    assert {"free", "occupied"} <= seen


def test_what_is_out_of_view_is_remembered_and_forgotten_after_a_while(begin) -> None:
    robot, plant = begin(hall(), crates=legs(STANDARD, PLACES["a"]), settings=NavigationSettings(rack_memory=4.0))
    idle(robot, plant, 2.5)
    plant.crates = [*plant.crates, box(2.6, 4.0, 0.2, 3.0)]
    idle(robot, plant, 2.5)
    assert states(robot)[0] == "occupied" and points(robot).seen_now("a") == "unknown"
    idle(robot, plant, 4.0)
    assert states(robot)[0] == "unknown"


def test_under_a_rack_its_point_is_occupied_and_with_the_rack_lifted_it_is_not_judged(begin) -> None:
    robot, plant = begin(hall(), pose=PLACES["a"], crates=legs(STANDARD, PLACES["a"]))
    robot.motion._take_load(Load.under(STANDARD, plant.pose))
    idle(robot, plant, 1.5)
    assert states(robot)[0] == "occupied"
    robot.motion._take_load(Load(state=LoadState.CARRYING, spec=STANDARD, rack_pose=(0.0, 0.0, 0.0)))
    idle(robot, plant, 2.5)
    assert points(robot).seen_now("a") == "unknown"


def test_the_outline_looked_at_holds_that_of_every_kind() -> None:
    assert largest_outline([STANDARD, LARGE]).tolist() == LARGE.outline().tolist()
    assert largest_outline([]).tolist() == [[0.0, 0.0]] * 4
    kinds = [STANDARD.model_copy(update={"margin": (0.4, 0.0, 0.0, 0.0)}), LARGE]
    assert largest_outline(kinds)[0].tolist() == pytest.approx([0.415 + 0.4, 0.5])
