"""Plans for the real body, and the reasons there may be none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.services.planner.behaviors.navigator import ChassisNavigator
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.map.test_grid import feature
from tests.planner.plant import Hall, box, keep_on, run


def bent_corridor(width: float) -> Hall:
    """From the left, along y = 4 to x = 7, then up to the top: too narrow to turn in below 0.88 m."""
    half = width / 2
    return Hall(
        12,
        8,
        [
            box(6.1, (4 - half) / 2, 6.2, 4 - half),
            box((7 + half + 12) / 2, 3, 5 - half, 6),
            box((7 - half) / 2, (4 + half + 6) / 2 + 0.5, 7 - half, 1 - half + 1),
            box((3 + 7 - half) / 2, (4 + half + 6) / 2, 4 - half, 2 - half),
        ],
    )


def straight_corridor(width: float) -> Hall:
    half = width / 2
    return Hall(12, 8, [box(5.5, (4 - half) / 2, 5, 4 - half), box(5.5, (12 + half) / 2, 5, 4 - half)])


def refused(begin, goal: Goal, reason: Reason, **where: object) -> str:
    """Refused before a wheel turns: by ``start``, or by a tick soon after for what needs a long search."""
    navigator, plant = begin(**where)
    with pytest.raises(MoveFailed) as failed:
        navigator.start(goal, plant.observe())
        keep_on(navigator, plant, 5)
    assert failed.value.reason is reason, failed.value.text
    assert all(abs(command.linear) + abs(command.angular) < 1e-9 for _, command in plant.commands)
    return failed.value.text


def test_no_map(begin) -> None:
    navigator, plant = begin()
    navigator.set_map(None)
    with pytest.raises(MoveFailed) as failed:
        navigator.start(Goal(3.0, 3.0), plant.observe())
    assert failed.value.reason is Reason.GET_MAP_FAILED


def test_bad_map_leaves_none(begin) -> None:
    navigator, plant = begin()
    with pytest.raises(MoveFailed) as failed:
        navigator.set_map(plant.hall.map().model_copy(update={"png": b"x"}))
    assert failed.value.reason is Reason.GET_MAP_FAILED
    with pytest.raises(MoveFailed, match="no map"):
        navigator.start(Goal(3.0, 3.0), plant.observe())


def test_start_out_of_map() -> None:
    from tests.planner.plant import Plant

    navigator, plant = ChassisNavigator(), Plant(Hall(10, 8), (1.5, 4.0, 0.0))
    navigator.set_map(plant.hall.map().model_copy(update={"origin": (3.0, 0.0)}))
    with pytest.raises(MoveFailed) as failed:
        navigator.start(Goal(5.0, 4.0), plant.observe())
    assert failed.value.reason is Reason.STARTING_POINT_OUT_OF_MAP


def test_goal_out_of_map(begin) -> None:
    assert "(12.00, 4.00)" in refused(begin, Goal(12.0, 4.0), Reason.ENDING_POINT_OUT_OF_MAP)


def test_start_in_a_no_go_region(begin) -> None:
    ring = [[1, 3], [2, 3], [2, 5], [1, 5]]
    hall = Hall(10, 8, overlays=[feature("Polygon", [ring], regionType=1)])
    refused(begin, Goal(5.0, 4.0), Reason.STARTING_POINT_NOT_IN_GROUND, hall=hall)


@pytest.mark.parametrize(
    "goal", [Goal(5.0, 4.0), Goal(5.0, 5.15), Goal(5.0, 5.3, 1.57)], ids=["in it", "circle", "body at heading"]
)
def test_goal_not_in_ground(begin, goal: Goal) -> None:
    refused(begin, goal, Reason.ENDING_POINT_NOT_IN_GROUND)


def test_goal_near_a_wall_is_fine_along_it(begin) -> None:
    navigator, plant = begin()
    run(navigator, plant, Goal(5.0, 5.32, 0.0), 60)
    assert plant.contacts == []


def test_start_is_goal(begin) -> None:
    refused(begin, Goal(1.5, 4.0, 0.0), Reason.STARTING_EQUAL_ENDING)
    refused(begin, Goal(1.5, 4.0), Reason.STARTING_EQUAL_ENDING)
    refused(begin, Goal(yaw=0.0), Reason.STARTING_EQUAL_ENDING)


def test_start_is_not_goal_with_another_heading_or_a_zone(begin) -> None:
    navigator, plant = begin()
    run(navigator, plant, Goal(1.5, 4.0, 0.3), 20)
    navigator, plant = begin()
    assert len(run(navigator, plant, Goal(1.5, 4.0, zone=True, accuracy=0.5), 1)) == 1


def test_roads_not_connected(begin) -> None:
    wall = feature("LineString", [[7, 0], [7, 8]], lineType=2)
    refused(begin, Goal(9.0, 4.0), Reason.CALCULATION_FAILED, hall=Hall(10, 8, overlays=[wall]))
    refused(begin, Goal(10.0, 4.0), Reason.CALCULATION_FAILED, hall=straight_corridor(0.4))


def test_search_out_of_budget(begin) -> None:
    settings = NavigationSettings(max_expansions=500)
    refused(begin, Goal(9.0, 4.0), Reason.CALCULATION_TIMEOUT, settings=settings)
    # Enough for the cells of the field, not for the states of the search with the body.
    hall = bent_corridor(0.65)
    navigator, _ = begin(hall)
    cells = int((~navigator._around.static.blocked).sum())
    settings = NavigationSettings(max_expansions=cells)
    refused(begin, Goal(7.0, 7.0), Reason.CALCULATION_TIMEOUT, hall=hall, settings=settings)


def test_the_circle_has_a_way_and_the_body_none(begin) -> None:
    text = refused(begin, Goal(7.0, 7.0, 1.57), Reason.NO_GLOBAL_PATH, hall=bent_corridor(0.65))
    assert "a path exists for the inscribed radius 0.23 m, none for the footprint" in text


def test_tight_bend_is_driven(begin) -> None:
    navigator, plant = begin(bent_corridor(0.8))
    navigator.start(Goal(7.0, 7.0, 1.57), plant.observe())
    assert navigator._run.route.plan.tight
    keep_on(navigator, plant, 60)
    assert plant.contacts == []


def test_out_of_a_corridor_backward_and_in_again(begin) -> None:
    navigator, plant = begin(straight_corridor(0.7), pose=(5.5, 4.0, 0.0))
    for goal in (Goal(1.5, 4.0, 0.0), Goal(5.5, 4.0, 0.0)):
        run(navigator, plant, goal, 60)
    assert plant.contacts == []


def test_unmapped_things_seal_the_way_for_longer_than_patience(begin) -> None:
    settings = NavigationSettings(sealed_patience=2.0)
    gate = Hall(10, 8, [box(6, 2, 0.3, 3), box(6, 6, 0.3, 3)])
    navigator, plant = begin(gate, settings=settings, crates=(box(6.0, 4.0, 0.6, 0.9),))
    with pytest.raises(MoveFailed, match="unmapped") as failed:
        run(navigator, plant, Goal(8.5, 4.0), 10)
    assert failed.value.reason is Reason.NO_GLOBAL_PATH
    assert plant.seconds == pytest.approx(2.4, abs=0.7)


def test_a_crate_that_vanished_while_idle_does_not_block(begin) -> None:
    from tests.planner.plant import idle

    gate = Hall(10, 8, [box(6, 2, 0.3, 3), box(6, 6, 0.3, 3)])
    navigator, plant = begin(gate, crates=(box(6.0, 4.0, 0.6, 0.9),))
    plant.crates = []
    idle(navigator, plant, 0.4)
    navigator.start(Goal(8.5, 4.0), plant.observe())
    assert navigator._run.route is not None


def test_virtual_wall_is_gone_round(begin) -> None:
    hall = Hall(10, 8, overlays=[feature("LineString", [[5, 0], [5, 6]], lineType="2")])
    navigator, plant = begin(hall)
    navigator.start(Goal(8.5, 4.0), plant.observe())
    path = navigator._run.route.ahead()
    assert path[np.abs(path[:, 0] - 5.0).argmin(), 1] > 6.2


def test_the_same_inputs_give_the_same_plan(begin) -> None:
    paths = []
    for _ in range(2):
        navigator, plant = begin()
        seen = replace(plant.observe(), pose=Pose2(x=1.5, y=4.0, yaw=0.0))
        navigator.start(Goal(8.5, 4.0), seen)
        paths.append(navigator._run.route.ahead())
    assert np.array_equal(*paths)
