from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.perception.viewpoints import along, viewpoints
from tests.planner.perception.test_rack_points import point
from tests.planner.plant import BODY, Hall, Robot, box, idle

LINE = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 0.0), (4.0, 3.0)])


@pytest.mark.parametrize(
    ("place", "metres", "nearest"),
    [((1.5, 1.0), 1.5, (1.5, 0.0)), ((6.0, 2.0), 6.0, (4.0, 2.0)), ((-1.0, 1.0), 0.0, (0.0, 0.0)),
     ((4.0, 9.0), 7.0, (4.0, 3.0))],
)  # fmt: skip
def test_the_place_along_a_line(place: tuple[float, float], metres: float, nearest: tuple[float, float]) -> None:
    travelled, found = along(LINE, np.array(place))
    assert travelled == pytest.approx(metres) and found == pytest.approx(nearest)


def seen_from(robot: Robot, line: np.ndarray | None = None) -> list[tuple[float, float]]:
    rack = robot.costmap.static.overlays.points[0]
    return viewpoints(robot.costmap, Footprint.of(BODY), robot.plant.pose, rack, line)


def test_the_nearest_free_places_in_sight_come_first_and_those_of_a_line_before_them(begin) -> None:
    hall = Hall(10, 8, [box(5.0, 4.0, 0.2, 1.0)], [point("a", 6.5, 4.0, 0.0)])
    robot, plant = begin(hall, pose=(2.5, 4.0, 0.0), crates=[box(6.5, 6.2, 0.3, 0.3)])
    idle(robot, plant, 1.0)
    found = seen_from(robot)
    assert found and (4.3, 4.0) not in found, "behind the wall"
    assert all(math.hypot(x - 6.5, y - 4.0) < 3.1 for x, y in found)
    assert all(math.hypot(x - 6.5, y - 6.2) > 0.5 for x, y in found), "where the crate is"
    away = [math.hypot(x - 2.5, y - 4.0) for x, y in found]
    assert away == sorted(away)
    assert seen_from(robot, np.array([(8.0, 1.0), (8.0, 7.0)]))[0] == (8.0, 4.0)


def test_a_point_that_is_walled_in_has_none(begin) -> None:
    x, y = 6.0, 4.0
    walls = [box(x, y + 0.9, 2, 0.1), box(x, y - 0.9, 2, 0.1), box(x + 0.9, y, 0.1, 2), box(x - 0.9, y, 0.1, 2)]
    robot, _ = begin(Hall(10, 8, walls, [point("a", x, y, 0.0)]))
    assert seen_from(robot) == []
