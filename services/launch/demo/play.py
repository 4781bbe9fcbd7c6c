"""Starts a cell, plays the story on it, and prints the table of its steps."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rackhand.services.launch.background import BackgroundCell, CellError
from rackhand.services.launch.demo import stage
from rackhand.services.launch.demo.arm import ArmClient
from rackhand.services.launch.demo.chassis import ChassisClient
from rackhand.services.launch.demo.console import Output
from rackhand.services.launch.demo.errors import StoryError
from rackhand.services.launch.demo.player import Player
from rackhand.services.launch.demo.story import STORY
from rackhand.worlds.data import WorldFileError
from rackhand.worlds.world_model import load_world

PICKER, INTRUDER = 10, 5  # priorities: the smaller number wins


def play(world: str, options: list[str]) -> int:
    """Play the story in a cell with these options of ``rackhand up``. Returns 0, or 1 and prints what failed."""
    output = Output()
    try:
        scene = stage.scene_of(load_world(world))  # before a cell is started in vain
        with tempfile.TemporaryDirectory(prefix="rackhand-demo-") as name:
            arguments = ["--world", world, "--crf-port", "0", *options]
            with stage.running(Path(name), arguments, output) as cell:
                output.say(f"page        {cell.http}/")
                if cell.viewer:
                    output.say(f"live view   {cell.viewer}")
                with on_stage(cell, scene, output) as player:
                    player.play(STORY)
    except (StoryError, CellError, WorldFileError) as error:
        print(f"rackhand demo: {error}", file=sys.stderr)
        return 1
    output.table()
    return 0


@contextmanager
def on_stage(cell: BackgroundCell, scene: stage.Scene, output: Output) -> Iterator[Player]:
    """A player with its clients, in a cell of that scene whose pick station is freed first."""
    stage.set_aside(cell.bus)
    address, waiting = cell.crf[stage.ARM], output.waiting
    with (
        ChassisClient(cell.http, waiting) as chassis,
        ArmClient(address, "picker", PICKER, waiting) as arm,
        ArmClient(address, "inspector", INTRUDER, waiting) as intruder,
    ):
        yield Player(chassis, arm, intruder, scene.base, scene.goods, output)
