"""Plans for the real body, and the reasons there may be none."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.map.grid import load_map
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.planning.plan import GlobalPlanner, NoPathFound, Plan, Target
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.map.test_grid import feature
from tests.planner.plant import BODY, Hall, Robot, box, keep_on, run


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


def plan_of(robot: Robot, target: Target) -> Plan:
    planner = GlobalPlanner(robot.costmap.static.geometry, Footprint.of(BODY), robot.motion.settings)
    return planner.plan(robot.motion.perception.pose, target, robot.costmap.blocked())


def refused(begin, goal: Goal, reason: Reason, **where: object) -> str:
    """Fails before a wheel turns."""
    robot, plant = begin(**where)
    with pytest.raises(MoveFailed) as failed:
        robot.start(goal)
        keep_on(robot, plant, 5)
    assert failed.value.reason is reason, failed.value.text
    assert all(abs(command.linear) + abs(command.angular) < 1e-9 for _, command in plant.commands)
    return failed.value.text


def test_a_bad_map_leaves_the_one_before(begin) -> None:
    robot, plant = begin()
    before = robot.motion.perception.costmap
    with pytest.raises(MoveFailed) as failed:
        robot.motion.set_map(plant.hall.map().model_copy(update={"png": b"x"}))
    assert failed.value.reason is Reason.GET_MAP_FAILED
    assert robot.motion.perception.costmap is before is not None


def test_start_out_of_map(begin) -> None:
    robot, plant = begin()
    robot.motion.set_map(plant.hall.map().model_copy(update={"origin": (3.0, 0.0)}))
    robot.start(Goal(5.0, 4.0))
    with pytest.raises(MoveFailed, match="outside the map") as failed:
        robot.tick()
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
    robot, plant = begin()
    run(robot, plant, Goal(5.0, 5.32, 0.0), 60)
    assert plant.contacts == []


@pytest.mark.parametrize(
    "goal", [Goal(1.5, 4.0, 0.0), Goal(1.5, 4.0), Goal(yaw=0.0), Goal(1.5, 4.0, 0.0, rotate_in_place=True)]
)
def test_a_goal_where_the_chassis_is_succeeds_at_once(begin, goal: Goal) -> None:
    robot, plant = begin()
    assert len(run(robot, plant, goal, 1)) == 1
    assert all(command == STANDSTILL for _, command in plant.commands)


def test_nothing_to_drive_and_nothing_to_turn_to(begin) -> None:
    text = refused(begin, Goal(1.5, 4.0, rotate_in_place=True), Reason.STARTING_EQUAL_ENDING)
    assert "inplace_rotate without target_ori" in text


def test_another_heading_is_turned_to_and_a_zone_reached_is_enough(begin) -> None:
    robot, plant = begin()
    run(robot, plant, Goal(1.5, 4.0, 0.3), 20)
    robot, plant = begin()
    assert len(run(robot, plant, Goal(1.5, 4.0, zone=True, accuracy=0.5), 1)) == 1


def test_roads_not_connected(begin) -> None:
    wall = feature("LineString", [[7, 0], [7, 8]], lineType=2)
    refused(begin, Goal(9.0, 4.0), Reason.CALCULATION_FAILED, hall=Hall(10, 8, overlays=[wall]))
    refused(begin, Goal(10.0, 4.0), Reason.CALCULATION_FAILED, hall=straight_corridor(0.4))


def test_search_out_of_budget(begin) -> None:
    settings = NavigationSettings(max_expansions=500)
    refused(begin, Goal(9.0, 4.0), Reason.CALCULATION_TIMEOUT, settings=settings)
    # Enough for the cells of the field, not for the states of the search with the body.
    hall = bent_corridor(0.65)
    robot, _ = begin(hall)
    cells = int((~robot.costmap.static.blocked).sum())
    settings = NavigationSettings(max_expansions=cells)
    refused(begin, Goal(7.0, 7.0), Reason.CALCULATION_TIMEOUT, hall=hall, settings=settings)


def test_the_circle_has_a_way_and_the_body_none(begin) -> None:
    text = refused(begin, Goal(7.0, 7.0, 1.57), Reason.NO_GLOBAL_PATH, hall=bent_corridor(0.65))
    assert "a path exists for the inscribed radius 0.23 m, none for the footprint" in text


def test_tight_bend_is_driven(begin) -> None:
    robot, plant = begin(bent_corridor(0.8))
    assert plan_of(robot, Target(7.0, 7.0, 1.57)).tight
    run(robot, plant, Goal(7.0, 7.0, 1.57), 60)
    assert plant.contacts == []


def test_out_of_a_corridor_backward_and_in_again(begin) -> None:
    robot, plant = begin(straight_corridor(0.7), pose=(5.5, 4.0, 0.0))
    for goal in (Goal(1.5, 4.0, 0.0), Goal(5.5, 4.0, 0.0)):
        run(robot, plant, goal, 60)
    assert plant.contacts == []


def test_unmapped_things_seal_the_way_for_longer_than_patience(begin) -> None:
    settings = NavigationSettings(planning_timeout=2.0)
    gate = Hall(10, 8, [box(6, 2, 0.3, 3), box(6, 6, 0.3, 3)])
    robot, plant = begin(gate, settings=settings, crates=(box(6.0, 4.0, 0.6, 0.9),))
    with pytest.raises(MoveFailed, match="observed obstacles block every one") as failed:
        run(robot, plant, Goal(8.5, 4.0), 10)
    assert failed.value.reason is Reason.PLANNING_TIMEOUT
    assert plant.seconds == pytest.approx(2.4, abs=0.7)


def test_a_crate_that_vanished_while_idle_does_not_block(begin) -> None:
    from tests.planner.plant import idle

    gate = Hall(10, 8, [box(6, 2, 0.3, 3), box(6, 6, 0.3, 3)])
    robot, plant = begin(gate, crates=(box(6.0, 4.0, 0.6, 0.9),))
    plant.crates = []
    idle(robot, plant, 0.4)
    assert plan_of(robot, Target(8.5, 4.0, None)).length == pytest.approx(7.0, abs=0.3)


def test_virtual_wall_is_gone_round(begin) -> None:
    hall = Hall(10, 8, overlays=[feature("LineString", [[5, 0], [5, 6]], lineType="2")])
    robot, _ = begin(hall)
    (segment,) = plan_of(robot, Target(8.5, 4.0, None)).segments
    path = segment.points
    assert path[np.abs(path[:, 0] - 5.0).argmin(), 1] > 6.2


def test_the_same_inputs_give_the_same_plan(begin) -> None:
    robot, _ = begin()
    first, second = (plan_of(robot, Target(8.5, 4.0, None)) for _ in range(2))
    assert np.array_equal(first.segments[0].points, second.segments[0].points)
    assert np.array_equal(first.cost, second.cost)


@pytest.mark.parametrize("goal", [(1e6, 2.0), (-3.0, 2.0), (2.0, -1e9)])
def test_a_goal_outside_the_map_has_no_path(goal: tuple[float, float]) -> None:
    data = Hall(10, 8, []).map()
    static = load_map(data, NavigationSettings().slow_zone_velocity)
    planner = GlobalPlanner(static.geometry, Footprint.of(BODY), NavigationSettings())
    with pytest.raises(NoPathFound, match="outside the map"):
        planner.plan(np.array([1.5, 4.0, 0.0]), Target(*goal, None), static.blocked)
