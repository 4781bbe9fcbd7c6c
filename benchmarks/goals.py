"""Twenty random goals in the warehouse, a person walking and two unmapped crates: times, and how smooth it is."""

from __future__ import annotations

import json
import math
import random
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from rich.progress import track
from scipy.ndimage import distance_transform_edt

from benchmarks.report import Report, median, percentile
from rackhand import worlds
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.world import Place
from rackhand.services.planner.chassis import PERIOD_NS
from rackhand.testing import distance, turn
from tests.joined.world import JoinedWorld
from tests.system.driving import standard

CRATES = {"crate_1": (9.4, 7.1), "crate_2": (14.3, 9.6)}
SEED, GOALS = 20, 20
CELL = 0.05  # m, of the map's picture
CLEARANCE = 0.7  # m, from a goal to anything: the chassis turns there
PERIOD = PERIOD_NS * 1e-9
Goal = tuple[float, float, float]
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """One goal: ``seconds`` taken, metres and degrees ``off`` it at the end by ground truth."""

    goal: Goal
    state: str
    seconds: float
    off: float
    turned: float


def run() -> Report:
    with tempfile.TemporaryDirectory() as folder, warehouse(Path(folder)) as world:
        goals = chosen_goals(world)
        rows = [drive_to(world, goal) for goal in track(goals, "goals")]
        contacts, commands = world.inspect().contact_count, world.chassis().commands
    seconds = [row.seconds for row in rows]
    jerk, lateral = jerks(commands), lateral_accelerations(commands)
    return Report(
        "Twenty goals in the warehouse",
        "python -m benchmarks goals",
        ("what", "median", "p95", "worst"),
        (
            ("s to a goal", *figures(seconds, "{:.1f}")),
            ("mm off the goal", *figures([1e3 * row.off for row in rows], "{:.0f}")),
            ("degrees off the goal", *figures([row.turned for row in rows], "{:.2f}")),
            ("jerk commanded, m/s³", *figures(jerk, "{:.2f}")),
            ("lateral acceleration commanded, m/s²", *figures(lateral, "{:.3f}")),
        ),
        f"{sum(row.state == 'succeeded' for row in rows)} of {len(rows)} reached, {contacts} contacts, "
        f"{sum(seconds):.0f} s in all. World `warehouse` in physics, one after the other, with the person who walks "
        "there and two crates that no map shows. Jerk and lateral acceleration are those of the stream of commands, "
        f"every {PERIOD:g} s in motion.",
    )


def figures(values: Sequence[float], form: str) -> tuple[str, str, str]:
    return form.format(median(values)), form.format(percentile(values, 0.95)), form.format(max(values))


# -- the goals ---------------------------------------------------------------------------------------------------------


def warehouse(folder: Path) -> JoinedWorld:
    """The joined warehouse with the two crates."""
    world = JoinedWorld("warehouse", folder, seed=SEED, with_arms=False)
    for name, (x, y) in CRATES.items():
        world.ask(Place(name=name, pose=Pose2(x=x, y=y, yaw=0.4), size=(0.5, 0.4, 0.5)))
    return world


def chosen_goals(world: JoinedWorld) -> list[Goal]:
    """The twenty."""
    return [*islice(free_goals(things(world) | CRATES, random.Random(SEED)), GOALS)]


def things(world: JoinedWorld) -> dict[str, tuple[float, float]]:
    """Where the racks truly are."""
    return {name: (pose.x, pose.y) for name, pose in world.true_poses().items() if name.startswith("rack")}


def free_goals(
    unmapped: Mapping[str, tuple[float, float]], rng: random.Random, room: float = CLEARANCE
) -> Iterator[Goal]:
    """Random poses with ``room`` metres around them, by the map's picture and by where unmapped things truly are."""
    ground, (left, lower) = allowed_ground()
    free = distance_transform_edt(ground) * CELL
    height, width = free.shape
    while True:
        x, y = rng.uniform(0.5, 19.5), rng.uniform(0.5, 13.5)
        row, column = int((y - lower) / CELL), int((x - left) / CELL)
        crowded = any(math.hypot(x - tx, y - ty) < room + 0.75 for tx, ty in unmapped.values())
        if row < height and column < width and free[row, column] > room and not crowded:
            yield x, y, rng.uniform(-math.pi, math.pi)


def allowed_ground() -> tuple[NDArray[np.bool_], tuple[float, float]]:
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


def drive_to(world: JoinedWorld, goal: Goal) -> Row:
    """Drive there; how it ended, and how far off the chassis truly is."""
    x, y, yaw = goal
    begun = world.now()
    move = world.chassis().drive(standard(x, y, yaw), within=300.0)
    pose = world.true_pose("amr1")
    return Row(goal, move.state, world.now() - begun, distance(pose, x, y), math.degrees(turn(pose.yaw, yaw)))


# -- how smoothly ------------------------------------------------------------------------------------------------------


def jerks(commands: Sequence[ChassisCommand]) -> list[float]:
    """m/s³ between the commands of a stream, without those at rest."""
    speed = np.array([command.twist.linear for command in commands])
    found = np.abs(np.diff(speed, 2)) / PERIOD**2
    return [float(value) for value in found[np.abs(speed[1:-1]) > 0.0]]


def lateral_accelerations(commands: Sequence[ChassisCommand]) -> list[float]:
    """m/s² of the commands of a stream, without those at rest."""
    return [abs(c.twist.linear * c.twist.angular) for c in commands if c.twist.linear != 0.0]
