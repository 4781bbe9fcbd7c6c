"""The demonstration in lockstep: its clients read only public APIs, the judge alone knows what happened."""

from __future__ import annotations

import io
import math
from pathlib import Path

import pytest
from rich.console import Console

from rackhand.services.launch.demo import stage
from rackhand.services.launch.demo.arm import ArmClient
from rackhand.services.launch.demo.chassis import ChassisClient
from rackhand.services.launch.demo.console import Output
from rackhand.services.launch.demo.play import INTRUDER, PICKER
from rackhand.services.launch.demo.player import Player
from rackhand.services.launch.demo.story import ITEMS, RACK, STORY
from rackhand.testing import Cell, distance
from rackhand.worlds.world_model import load_world

STORED = (7.8, 12.2)
TABLE_TOP = 0.7


def test_the_story_is_played_to_its_end(tmp_path: Path) -> None:
    printed = io.StringIO()
    output = Output(Console(file=printed, width=120))
    world = load_world("warehouse")
    with Cell(tmp_path, seed=3) as cell:
        stage.set_aside(cell.bus)
        with (
            ChassisClient(cell.http, output.waiting) as chassis,
            ArmClient(cell.crf["arm1"], "picker", PICKER, output.waiting) as arm,
            ArmClient(cell.crf["arm1"], "inspector", INTRUDER, output.waiting) as intruder,
        ):
            player = Player(chassis, arm, intruder, stage.base_of(world), stage.inventory(world), output)
            player.play(STORY)
            output.table()
            assert arm.status()["priorityUnderControl"] == 0
        cell.pause()
        things = cell.objects()
        for name in ITEMS:
            x, y, z = things[name].position
            assert math.dist((x, y), stage.TARGETS[name]) < 0.03, name
            assert z == pytest.approx(TABLE_TOP + 0.06, abs=0.005), f"{name} stands on the table"
        assert distance(cell.true_pose(RACK), *STORED) < 0.04
        assert cell.contacts() == ()
    text = printed.getvalue()
    assert [line for line in text.splitlines() if line.startswith(f"{len(STORY):>2}/{len(STORY)}")]
    assert all(step.title in text for step in STORY)
