"""What was seen once may have been taken away: where it closes every path the chassis goes there and looks."""

from __future__ import annotations

import math

import pytest

from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import Hall, Plant, Robot, box, idle, run

IMPATIENT = NavigationSettings(planning_timeout=8.0)
BEHIND = Goal(12.0, 4.5)
TWO_DOORS = Hall(14, 9, [box(10, 4.5, 0.2, 5.4), box(6.5, 4.5, 7.0, 0.2)])  # and a wall between the ways to them
DOORS = (box(10, 8.0, 0.4, 1.4), box(10, 1.0, 0.4, 1.4))  # crates that close them


@pytest.fixture
def out_of_sight(begin) -> tuple[Robot, Plant]:
    """Both doors were seen to be closed, each from its side of the wall; now neither is."""
    robot, _ = begin(TWO_DOORS, (7.0, 1.5, 0.0), IMPATIENT, crates=DOORS)
    for pose in ((7.0, 7.5, 0.0), (1.0, 4.5, 0.0)):
        plant = Plant(TWO_DOORS, pose)
        plant.crates = list(DOORS)
        robot.restart(plant)
        idle(robot, plant, 0.4)
    assert len(robot.costmap.observed_cells()) > 40
    idle(robot, plant, 5.0)
    assert len(robot.costmap.observed_cells(5.0)) == 0
    return robot, plant


def test_what_was_taken_away_out_of_sight_closes_no_path(out_of_sight: tuple[Robot, Plant]) -> None:
    robot, plant = out_of_sight
    plant.crates.pop(1)
    run(robot, plant, BEHIND, 60)
    assert math.hypot(plant.pose[0] - BEHIND.x, plant.pose[1] - BEHIND.y) < 0.05
    assert plant.contacts == []


def test_each_closed_door_is_looked_at_once_before_there_is_no_path(out_of_sight: tuple[Robot, Plant]) -> None:
    robot, plant = out_of_sight
    robot.start(BEHIND)
    visits: list[str] = []
    with pytest.raises(MoveFailed) as failed:
        for _ in range(80 * 25):
            plant.drive(robot.tick().twist)
            if plant.pose[0] > 4.0 and (door := "upper" if plant.pose[1] > 4.5 else "lower") not in visits[-1:]:
                visits.append(door)
    assert failed.value.reason is Reason.PLANNING_TIMEOUT, failed.value.text
    assert sorted(visits) == ["lower", "upper"]
    assert plant.contacts == []


def test_only_what_a_beam_met_lately_is_among_the_cells(begin) -> None:
    robot, plant = begin(Hall(12, 6), (2.0, 3.0, 0.0), crates=(box(5.0, 3.0, 0.5, 0.5),))

    def of_crate(within: float) -> int:
        return int((robot.costmap.static.geometry.centres(robot.costmap.observed_cells(within))[:, 0] > 4.5).sum())

    assert of_crate(1.0) == of_crate(math.inf) > 5
    plant.crates = [box(3.5, 3.0, 0.1, 3.0)]  # hides where the other was
    idle(robot, plant, 1.2)
    assert of_crate(1.0) == 0 and of_crate(math.inf) > 5
