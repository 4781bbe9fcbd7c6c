"""The map of a world is its geometry in the plane of the lidar."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from rackhand.services.sim.world import maps
from rackhand.worlds.world_model import known_worlds, load_world, world_directory
from tests.sim.helpers import make_simulation, make_world


@pytest.mark.parametrize("name", known_worlds())
def test_the_committed_map_is_that_of_the_world(name: str) -> None:
    world, folder = load_world(name), world_directory(name)
    for floor in world.bounds_of_floors:
        place = maps.floor_folder(folder, floor)
        with Image.open(place / "map.png") as image:
            np.testing.assert_array_equal(np.asarray(image), maps.draw(world, floor))
        assert yaml.safe_load((place / "map.yaml").read_text()) == maps.description(world, floor)


def cell(world: Any, x: float, y: float) -> int:
    left, bottom = maps.map_origin(world)
    resolution = world.map.resolution
    return int(maps.draw(world)[::-1][int((y - bottom) / resolution), int((x - left) / resolution)])


def test_a_map_shows_what_does_not_move_in_the_plane_of_the_lidar() -> None:
    world = make_world(
        statics={
            "low": {"kind": "box", "pose": (1, 0, 0), "size": (0.5, 0.5, 0.1)},
            "high": {"kind": "box", "pose": (3, 0, 0), "size": (0.5, 0.5, 1), "z": 0.5},
            "cut": {"kind": "box", "pose": (5, 0, 0.785), "size": (1, 0.2, 1)},
            "secret": {"kind": "cylinder", "centre": (7, 0), "radius": 0.3, "height": 1, "mapped": False},
        },
        rack_kinds={"standard": {"size": (1, 1), "underside": 0.3, "height": 1.0, "mass": 50}},
        racks={"a1": {"kind": "standard", "pose": (3, 5, 0)}},
        movers={"anna": {"motion": {"kind": "stand", "pose": (5, 5, 0)}}},
        chargers={"dock": {"pose": (-9, 0, 0), "dock": (-8, 0, 0)}},
    )
    assert cell(world, 1.0, 0.0) == cell(world, 3.0, 0.0) == cell(world, 7.0, 0.0) == maps.FREE
    assert cell(world, 5.3, 0.3) == maps.OCCUPIED and cell(world, 5.3, -0.3) == maps.FREE
    assert cell(world, 3.48, 5.48) == cell(world, 5.0, 5.0) == maps.FREE
    assert cell(world, -9.0, 0.0) == maps.OCCUPIED
    assert cell(world, -10.3, 0.0) == maps.UNKNOWN


def test_the_map_agrees_with_the_physics() -> None:
    """Every beam of the warehouse's first scan that hits a static ends in or beside an occupied cell."""
    world = load_world("warehouse").model_copy(update={"racks": {}, "items": {}, "movers": {}})
    simulation = make_simulation(world)
    scan = next(o.message for o in simulation.outputs if o.topic.name == "chassis/scan")
    x, y, yaw = simulation.robots["amr1"].pose
    angles = scan.angle_min + scan.angle_step * np.arange(len(scan.ranges)) + yaw
    ranges = scan.ranges + 1e-3
    columns = ((x + scan.sensor.x + ranges * np.cos(angles) + 0.5) / 0.05).astype(int)
    rows = ((y + ranges * np.sin(angles) + 0.5) / 0.05).astype(int)
    assert (maps.draw(world)[::-1][rows, columns] == maps.OCCUPIED).mean() > 0.99
