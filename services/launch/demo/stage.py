"""Where the story plays: a cell of its own, the inventory of the world, and a pick station that is free."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from rackhand.schemas import planar
from rackhand.services.launch.background import START, BackgroundCell
from rackhand.services.launch.demo.console import Output
from rackhand.services.launch.demo.errors import StoryError
from rackhand.services.launch.demo.picking import Base, Goods
from rackhand.services.launch.demo.story import ITEMS, RACK
from rackhand.worlds.world_model import World

ARM, TABLE = "arm1", "tote_table"
# Where the middles of the jars are to stand on the table, in the map. A jar comes down as far beside its place as the
# rack stood beside where the robot saw it: that is the error of its localised pose, 5 to 20 mm. So there is more room
# than that to what lies there already; among each other they are off alike.
TARGETS = {"jar_1": (18.203, 11.585), "jar_2": (17.947, 11.585), "jar_3": (18.08, 11.585)}
# The story presents a rack where another one stands in the world's file; a simulator sets that aside.
SET_ASIDE, ASIDE = "rack_p3", (14.6, 12.2, math.pi / 2)


@contextmanager
def running(folder: Path, options: list[str], output: Output) -> Iterator[BackgroundCell]:
    """A cell of its own on free ports, with what it prints in ``folder``."""
    cell = BackgroundCell(folder, options)
    with output.progress():
        output.waiting("the cell to start; the first start compiles its control loops, which takes minutes")
        cell.start()
        try:
            cell.wait_until_up(START)
        except BaseException:
            cell.stop()
            raise
    try:
        yield cell
    finally:
        cell.stop()


def set_aside(endpoint: str) -> None:
    """Move the rack that stands at the pick station to the rack point beside it, as a user of the simulator does.

    Raises ``StoryError`` if the simulator refuses.
    """
    at = [f"{number:.4f}" for number in ASIDE]
    command = [sys.executable, "-m", "rackhand.services.launch", "world", "move", SET_ASIDE, "--at", *at]
    environment = {**os.environ, "RACKHAND_BUS_CONNECT": endpoint}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise StoryError(f"{SET_ASIDE} cannot be moved to {', '.join(at)}: {(done.stderr or done.stdout).strip()}")


class Scene(NamedTuple):
    """What the story needs of a world: where the arm's base is, and the items on their rack, by name."""

    base: Base
    goods: dict[str, Goods]


def scene_of(world: World) -> Scene:
    """Raises ``StoryError`` if something is missing in the world."""
    return Scene(_base_of(world), _inventory(world))


def _base_of(world: World) -> Base:
    if ARM not in world.arms:
        raise StoryError(f"world {world.name} has no arm {ARM}; the story needs one beside a rack point")
    place = world.arms[ARM]
    return Base(place.pose, place.mount)


def _inventory(world: World) -> dict[str, Goods]:
    missing = [name for name in ITEMS if name not in world.items] + [n for n in (RACK,) if n not in world.racks]
    if missing or TABLE not in world.statics:
        raise StoryError(f"world {world.name} lacks {', '.join(missing) or TABLE}, which the story needs")
    surfaces, rack = world.surfaces(), world.racks[RACK]
    table = surfaces[TABLE].height(None)
    goods = {}
    for name in ITEMS:
        item = world.items[name]
        x, y, _ = planar.between(rack.pose, item.pose)
        height = item.size[2]
        goods[name] = Goods(name, (x, y, surfaces[RACK].height(item.level) + height), height, TARGETS[name], table)
    return goods
