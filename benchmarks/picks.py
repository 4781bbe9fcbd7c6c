"""Pick and place of the items on the table of the warehouse's pick station, in turn, until one is dropped."""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.progress import track
from benchmarks.report import Report
from rackhand.schemas.arrays import Array
from rackhand.worlds.arm_model import GRIPPER_LENGTH
from rackhand.worlds.world_model import World, load_world
from tests.joined.arm import JoinedArm
from tests.joined.world import JoinedWorld

COUNT = 50
WORLD, ARM = "warehouse", "arm1"
ABOVE, LIFT = 0.1, 0.2  # m above an item before the pick, and of the carried item above where it lay
PRESS = 5e-4  # m by which the cup is pressed on
SWING = 0.6  # rad of joint 0 to the side and back
CREPT = 1e-3  # m that an item may be off in the frame of the cup


@dataclass(frozen=True)
class Options:
    """``count``: how many picks."""

    count: int = COUNT


@dataclass(frozen=True)
class Pick:
    """``held``: from the pick until it was let go; ``crept`` [m]: in the frame of the cup, meanwhile; ``off`` [m]: from
    where it was to be put down."""

    item: str
    held: bool
    crept: float
    off: float


def run(options: Options = Options()) -> Report:
    with tempfile.TemporaryDirectory() as folder:
        world = JoinedWorld(station(), Path(folder), with_chassis=False)
        picker = Picker(world.arm(ARM))
        items = sorted(world.simulation.world.items)
        picks = [picker.pick(items[number % len(items)], number) for number in track(range(options.count), "picks")]
    rows = []
    for item in items:
        own = [pick for pick in picks if pick.item == item]
        if own:
            rows.append(
                (
                    item,
                    f"{sum(p.held for p in own)} of {len(own)}",
                    f"{1e3 * max(p.crept for p in own):.3f}",
                    f"{1e3 * max(p.off for p in own):.1f}",
                )
            )
    return Report(
        "Pick and place",
        "python -m benchmarks picks",
        ("item", "held all the time", "crept at the cup (mm)", "off its place (mm)"),
        rows,
        f"World `{WORLD}`, the items on the table beside the arm in turn, {options.count} picks: pressed on, lifted by "
        f"{LIFT:g} m, swung {SWING:g} rad aside and back at the default profile, put down where it lay. "
        "Greatest values.",
    )


def station() -> World:
    """The arm and its table; without the robots, people and racks of the hall."""
    world = load_world(WORLD)
    items = {name: item for name, item in world.items.items() if item.lies_on == "tote_table"}
    return world.model_copy(update={"robots": {}, "movers": {}, "racks": {}, "items": items})


def up(height: float) -> Array:
    return np.array([0.0, 0.0, height])


class Picker:
    """A client of one arm."""

    def __init__(self, station: JoinedArm) -> None:
        self._station, self._data = station, station.world.simulation.data
        place = station.world.simulation.world.arms[station.name]
        x, y, yaw = place.pose
        c, s = math.cos(yaw), math.sin(yaw)
        self._turn, self._base = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.array([x, y, place.mount])
        station.advance(0.04)

    def pick(self, item: str, number: int) -> Pick:
        lay = self._data.body(item).xpos.copy()
        top = lay + up(self._station.world.simulation.world.items[item].size[2] / 2)
        self._to(top + up(ABOVE), method=1)
        self._to(top - up(PRESS))
        self._station.ok(command="setGripper", suction=True)
        self._station.advance(0.3)
        begun = self._at_the_cup(item)
        crept, held = 0.0, True
        for move in (
            lambda: self._to(top + up(LIFT)),
            lambda: self._swing(SWING * (-1) ** number),
            lambda: self._to(top),
        ):
            move()
            held = held and bool(self._station.status()["gripper"]["holding"])
            crept = max(crept, float(np.linalg.norm(self._at_the_cup(item) - begun)))
        self._station.ok(command="setGripper", suction=False)
        self._station.advance(0.3)
        self._to(top + up(ABOVE))
        off = float(np.linalg.norm(self._data.body(item).xpos - lay))
        return Pick(item, held and crept < CREPT, crept, off)

    def _to(self, rim: Array, method: int = 2) -> None:
        """The rim of the cup to a place in the map, pointing down."""
        flange = self._turn.T @ (rim + up(GRIPPER_LENGTH) - self._base)
        half = math.sqrt(0.5)
        pose = {"Position": flange.tolist(), "Orientation": {"Quaternion": {"W": 0, "X": half, "Y": half, "Z": 0}}}
        self._station.ok(command="appendPath", type="task", method=method, reference=1, data=[pose])
        self._arrive()

    def _swing(self, angle: float) -> None:
        """Joint 0 by ``angle`` and back."""
        q = np.array(self._station.states[-1].q)
        aside = q + angle * np.eye(q.size)[0]
        self._station.ok(command="appendPath", type="joints", data=[aside.tolist(), q.tolist()])
        self._arrive()

    def _arrive(self) -> None:
        done = self._station.status
        self._station.world.wait_for(lambda: None if done()["isTrajectoryRunning"]["value"] else True, "it is there")
        self._station.advance(0.1)

    def _at_the_cup(self, item: str) -> Array:
        tool: Any = self._data.site(f"{self._station.name}/tool")
        return np.asarray(tool.xmat.reshape(3, 3).T @ (self._data.body(item).xpos - tool.xpos))
