"""Who can touch whom, and what the lidar sees: collision bits and geom groups of everything in the scene.

Two geoms are tested when the ``contype`` of one meets the ``conaffinity`` of the other. Wheels and casters meet the
floor only and a chassis' body all but the floor, so that whatever meets the body is a collision worth telling.
"""

from __future__ import annotations

from dataclasses import dataclass

FLOOR_BIT, STATIC_BIT, RACK_BIT, ROBOT_BIT, PLATE_BIT, OBSTACLE_BIT, ARM_BIT, ITEM_BIT = 1, 2, 4, 8, 16, 32, 64, 128
# Of all that fills space, but for wheels and casters.
SOLID_BITS = STATIC_BIT | RACK_BIT | ROBOT_BIT | PLATE_BIT | OBSTACLE_BIT | ARM_BIT | ITEM_BIT

# Geom groups: what a lidar sees is one group, all else is not in it.
FLOOR_GROUP, VISIBLE_GROUP, RUNNING_GEAR_GROUP, PARKED_GROUP = 0, 1, 2, 5


@dataclass(frozen=True)
class Layer:
    contype: int
    conaffinity: int
    group: int


FLOOR = Layer(FLOOR_BIT, 0, FLOOR_GROUP)
STATIC = Layer(STATIC_BIT, 0, VISIBLE_GROUP)
RACK = Layer(RACK_BIT, FLOOR_BIT | STATIC_BIT | RACK_BIT | OBSTACLE_BIT, VISIBLE_GROUP)
HULL = Layer(ROBOT_BIT, STATIC_BIT | RACK_BIT | ROBOT_BIT | OBSTACLE_BIT, VISIBLE_GROUP)
RUNNING_GEAR = Layer(0, FLOOR_BIT, RUNNING_GEAR_GROUP)
PLATE = Layer(PLATE_BIT, RACK_BIT, RUNNING_GEAR_GROUP)
OBSTACLE = Layer(OBSTACLE_BIT, 0, VISIBLE_GROUP)
ARM = Layer(ARM_BIT, FLOOR_BIT | STATIC_BIT | RACK_BIT | ROBOT_BIT | PLATE_BIT | OBSTACLE_BIT | ARM_BIT, VISIBLE_GROUP)
ITEM = Layer(ITEM_BIT, FLOOR_BIT | STATIC_BIT | RACK_BIT | ROBOT_BIT | OBSTACLE_BIT | ARM_BIT | ITEM_BIT, VISIBLE_GROUP)
DRAWN_ONLY = Layer(0, 0, RUNNING_GEAR_GROUP)
