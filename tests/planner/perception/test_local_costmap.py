from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from tests.planner.plant import BODY, Walker, box, idle


def occupied_near(around: LocalCostmap, x: float, y: float, reach: float = 0.4) -> bool:
    row, column = around.static.geometry.cell(x, y)
    n = int(reach / 0.05)
    return bool(around.observed.occupied((slice(row - n, row + n), slice(column - n, column + n))).any())


def test_mapped_things_are_no_new_obstacles(begin) -> None:
    robot, plant = begin()
    idle(robot, plant, 4.0)
    assert robot.costmap.observed.occupied().sum() == 0


def test_a_crate_appears_and_vanishes_while_idle(begin) -> None:
    robot, plant = begin()
    plant.crates = [box(3.0, 4.5, 0.5, 0.5)]
    idle(robot, plant, 0.2)
    assert occupied_near(robot.costmap, 3.0, 4.5)
    plant.crates = []
    idle(robot, plant, 0.4)
    assert not occupied_near(robot.costmap, 3.0, 4.5)


def test_what_moves_is_followed_and_leaves_no_trail(begin) -> None:
    robot, plant = begin(walkers=(Walker(np.array([(3.0, 1.0), (3.0, 7.0)]), 1.0),))
    idle(robot, plant, 3.0)
    walker = plant.walkers[0]
    (row,) = robot.costmap.movers.rows()
    assert math.hypot(*(row[:2] - walker.position)) < 0.25
    assert row[2:4] == pytest.approx([0.0, 1.0], abs=0.25)
    assert not occupied_near(robot.costmap, 3.0, walker.position[1] - 1.2, 0.6)


def test_a_dynamic_obstacle_does_not_block_plans_and_becomes_static_when_it_stops(begin) -> None:
    robot, plant = begin(walkers=(Walker(np.array([(3.0, 1.0), (3.0, 7.0)]), 1.0),))
    idle(robot, plant, 3.0)
    around = robot.costmap
    x, y = plant.walkers[0].position
    cell = around.static.geometry.cell(x - 0.22, y)
    window = (slice(cell[0] - 4, cell[0] + 5), slice(cell[1] - 4, cell[1] + 5))
    assert around.observed.occupied(window).any() and not around.blocked()[window].any()
    plant.walkers[0].speed = 0.0
    idle(robot, plant, 1.5)
    assert len(around.movers.rows()) == 0
    assert around.blocked()[window].any()


def test_a_standing_crate_is_no_mover_when_the_robot_drives_by(begin) -> None:
    from rackhand.services.planner.planning.goals import Goal

    robot, plant = begin(crates=(box(4.0, 2.0, 0.5, 0.5, 0.4), box(6.5, 2.0, 0.4, 0.6)))
    robot.start(Goal(8.5, 1.0, None))
    moving = 0
    for _ in range(800):
        progress = robot.tick()
        moving += len(robot.costmap.movers.rows())
        plant.drive(progress.twist)
        if progress.arrived:
            break
    assert progress.arrived and moving == 0


def test_hits_on_the_own_body_are_none(begin) -> None:
    robot, plant = begin()
    scan = plant.observe().scan
    ranges = scan.ranges.copy()
    ranges[300:420] = 0.1
    robot.costmap.look(scan.model_copy(update={"ranges": ranges}), plant.pose, Footprint.of(BODY))
    assert not occupied_near(robot.costmap, 1.6, 4.0, 0.3)
