"""Worlds of the BARN benchmark."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rackhand.services.sim.world import maps
from rackhand.services.sim.world.barn import read_barn, write_barn_world
from rackhand.worlds.data import WorldFileError
from rackhand.worlds.world_model import load_world
from tests.sim.helpers import make_simulation

BARN = {
    "meta": {
        "source": "somewhere",
        "cylinder_radius": 0.075,
        "cylinder_height": 1.0,
        "start": [-2.25, 3, 1.5708],
        "goal": [-2.25, 13],
        "goal_radius": 1.0,
        "timeout": 100,
        "robot": "Jackal",
    },
    "worlds": {
        "1": {"cylinders": [[-4.4, 5.0], [-1.0, 9.0]], "path_length": 12.4},
        "2": {"cylinders": [], "path_length": 1},
    },
}


def test_a_barn_world_has_its_cylinders_a_jackal_and_an_empty_map(tmp_path: Path) -> None:
    file = tmp_path / "worlds.json"
    file.write_text(json.dumps(BARN))
    write_barn_world(file, "1", tmp_path / "barn_1")
    world = load_world(str(tmp_path / "barn_1"))
    assert world == read_barn(file, "1")
    assert world.robots["amr1"].profile == "jackal" and world.robots["amr1"].pose == (-2.25, 3, 1.5708)
    assert world.task is not None and world.task.goal == (-2.25, 13) and len(world.statics) == 2
    with Image.open(tmp_path / "barn_1" / "map.png") as image:
        grid = np.asarray(image)
    assert maps.OCCUPIED not in grid and (grid == maps.FREE).any()
    simulation = make_simulation(world)
    scan = next(o.message for o in simulation.outputs if o.topic.name == "chassis/scan")
    assert np.min(scan.ranges) == pytest.approx(np.hypot(2.15, 2.0 - 0.12) - 0.075, abs=0.01)


@pytest.mark.parametrize(
    ("content", "number", "told"),
    [
        ("{", "1", "not JSON"),
        ("[]", "1", "the file"),
        (json.dumps(BARN), "7", "no world '7'; there are 2, 1 … 2"),
        (json.dumps(BARN), "2", "cylinders"),
        (json.dumps({"worlds": {}}), "1", "meta"),
    ],
)
def test_wrong_barn_data_is_reported(tmp_path: Path, content: str, number: str, told: str) -> None:
    file = tmp_path / "worlds.json"
    file.write_text(content)
    with pytest.raises(WorldFileError, match=told):
        read_barn(file, number)
