"""Eight seeded goals in a cluttered hall, with crates that are not on the map and somebody who walks in a loop."""

from __future__ import annotations

import math

import numpy as np

from rackhand.services.planner.geometry.se2 import wrap
from rackhand.services.planner.planning.goals import Goal
from tests.planner.plant import BODY, Hall, Plant, Walker, box, overlap, run

HALL = Hall(14, 10, [box(3.5, 3.5, 0.6, 3), box(7, 7, 0.5, 3.5), box(10.5, 3, 0.6, 3), box(11, 7, 2, 0.5, 0.4)])
CRATES = (box(5.3, 3.8, 0.6, 0.4, 0.3), box(9.2, 8.3, 0.5, 0.5, 0.8))
LOOP = np.array([(2, 1), (5.2, 1.5), (5.3, 6), (2, 8), (2, 5)])


def free_goals(seed: int, count: int) -> list[Goal]:
    """Goals where the body has 8 cm of room."""
    random, goals = np.random.default_rng(seed), []
    while len(goals) < count:
        x, y, yaw = random.uniform((0.7, 0.7, -math.pi), (13.3, 9.3, math.pi))
        c, s = math.cos(yaw), math.sin(yaw)
        body = (BODY + 0.08 * np.sign(BODY)) @ np.array([(c, s), (-s, c)]) + (x, y)
        if not any(overlap(body, thing) for thing in (*HALL.mapped, *CRATES)):
            goals.append(Goal(x, y, yaw))
    return goals


def error(plant: Plant, goal: Goal) -> tuple[float, float]:
    return math.hypot(plant.pose[0] - goal.x, plant.pose[1] - goal.y), abs(wrap(plant.pose[2] - goal.yaw))


def test_eight_goals_are_reached_and_nothing_is_touched(begin) -> None:
    walker = Walker(LOOP, 1.0, polite=True)
    robot, plant = begin(HALL, pose=(1.5, 1.5, 0.0), crates=CRATES, walkers=(walker,), seed=7)
    errors = []
    for goal in free_goals(7, 8):
        run(robot, plant, goal, 120)
        errors.append(error(plant, goal))
    assert plant.contacts == []
    distance, yaw = np.max(errors, axis=0)
    assert distance < 0.04 and yaw < math.radians(1.5)
