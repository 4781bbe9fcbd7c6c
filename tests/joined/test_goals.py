"""Random goals in the warehouse, a person walking and two unmapped crates: all reached, nothing touched."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image, ImageDraw
from scipy.ndimage import distance_transform_edt

from rackhand import worlds
from rackhand.schemas.base import Pose2
from rackhand.schemas.world import Place
from rackhand.testing import distance, turn
from tests.joined.world import JoinedWorld
from tests.system.driving import standard

CRATES = {"crate_1": (9.4, 7.1), "crate_2": (14.3, 9.6)}
SEED, GOALS = 20, 6
PARTS = 2  # each a test of its own, from the start
CELL = 0.05  # m, of the map's picture
CLEARANCE = 0.7  # m, from a goal to anything: the chassis turns there


def free_goals(things: dict[str, tuple[float, float]]) -> Iterator[tuple[float, float, float]]:
    """Random poses with room around them, by the map's picture and by where racks and crates truly stand."""
    ground, (left, lower) = allowed_ground()
    room = distance_transform_edt(ground) * CELL
    height, width = room.shape
    rng = random.Random(SEED)
    while True:
        x, y = rng.uniform(0.5, 19.5), rng.uniform(0.5, 13.5)
        row, column = int((y - lower) / CELL), int((x - left) / CELL)
        crowded = any(math.hypot(x - tx, y - ty) < CLEARANCE + 0.75 for tx, ty in things.values())
        if row < height and column < width and room[row, column] > CLEARANCE and not crowded:
            yield x, y, rng.uniform(-math.pi, math.pi)


def allowed_ground() -> tuple[np.ndarray, tuple[float, float]]:
    """Where the map is free and no overlay forbids to be, rows from the lower edge up; the corner of the first cell."""
    folder = Path(worlds.__file__).parent / "warehouse"
    picture = Image.open(folder / "map.png").convert("L")
    pen = ImageDraw.Draw(picture)
    left, lower, _ = yaml.safe_load((folder / "map.yaml").read_text())["origin"]

    def pixels(points: list[list[float]]) -> list[tuple[float, float]]:
        return [((x - left) / CELL, picture.height - (y - lower) / CELL) for x, y in points]

    for feature in json.loads((folder / "overlays.geojson").read_text())["features"]:
        kind, coordinates = feature["properties"], feature["geometry"]["coordinates"]
        if str(kind.get("lineType")) == "2":
            pen.line(pixels(coordinates), fill=0, width=2)
        elif str(kind.get("regionType")) in ("1", "3"):  # no-go regions, and the lift
            pen.polygon(pixels(coordinates[0]), fill=0)
    return (np.asarray(picture) > 200)[::-1], (left, lower)


def print_table(rows: list[tuple[Any, ...]]) -> None:
    print(f"\n{'goal':>4} {'x':>6} {'y':>6} {'yaw':>6} {'state':<10} {'s':>6} {'off m':>6} {'off °':>6} contacts")
    for row in rows:
        print("{:>4} {:>6.2f} {:>6.2f} {:>6.2f} {:<10} {:>6.1f} {:>6.3f} {:>6.2f} {:>8}".format(*row))


@pytest.mark.parametrize("part", range(PARTS))
def test_the_goals_are_reached_and_nothing_is_touched(
    part: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with JoinedWorld("warehouse", tmp_path, seed=SEED, with_arms=False) as world:
        for name, (x, y) in CRATES.items():
            world.ask(Place(name=name, pose=Pose2(x=x, y=y, yaw=0.4), size=(0.5, 0.4, 0.5)))
        racks = {name: (pose.x, pose.y) for name, pose in world.true_poses().items() if name.startswith("rack")}
        goals = [*islice(free_goals(racks | CRATES), GOALS)]
        rows = [drive_to(world, number, goals[number]) for number in range(part, GOALS, PARTS)]
        with capsys.disabled():  # the table is a result, not a diagnosis
            print_table(rows)
        assert {row[4] for row in rows} == {"succeeded"}
        assert max(row[6] for row in rows) <= 0.05
        assert max(row[7] for row in rows) <= 2.0
        assert world.inspect().contacts == ()


def drive_to(world: JoinedWorld, number: int, goal: tuple[float, float, float]) -> tuple[Any, ...]:
    """A row of the table: the goal, how the move ended, and how far off the chassis truly is."""
    x, y, yaw = goal
    begun = world.now()
    move = world.chassis().drive(standard(x, y, yaw), within=300.0)
    pose, contacts = world.true_pose("amr1"), world.inspect().contact_count
    off, turned = distance(pose, x, y), math.degrees(turn(pose.yaw, yaw))
    return number, x, y, yaw, move.state, world.now() - begun, off, turned, contacts
