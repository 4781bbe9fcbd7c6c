"""A random goal every ten seconds in a random place, replacing whatever runs, while crates come and go: in physics.

    python -m benchmarks random_goals --minutes 30

Goals are anywhere in the hall, also in walls, in racks and behind what nobody mapped. Each ten minutes are a world of
their own, so that a run can go on where it was broken off and any of them can be repeated alone.
"""

from __future__ import annotations

import json
import math
import random
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from scipy import ndimage

from benchmarks.goals import CELL, allowed_ground, free_goals
from benchmarks.report import Report
from rackhand.schemas.base import NANOSECONDS, Pose2
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.world import Contact, Place, Remove
from rackhand.testing import distance
from tests.joined.world import JoinedWorld
from tests.system.driving import standard

MINUTES, PART = 120, 10  # minutes of simulation: of a whole run, and of one world
PERIOD = 10.0  # s between two goals
STEP = 1.0  # s between two looks at the contacts
CRATE = (0.5, 0.4, 0.5)  # m
MOST_CRATES = 8
CRATE_CHANCE = 0.5  # with each goal, that one is placed or removed
FROM_ROBOT, FROM_PERSON = 1.8, 1.0  # m from a new crate's middle
LAST_GOALS, WITHIN = 3, 240.0  # goals at the end that must be reached, and s for each
ROOM = 0.5  # m from the middle of a robot to anything, where it passes in any heading
AT_REST = 0.02  # m/s and rad/s
Point = tuple[float, float]
Crates = dict[str, Point]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Part:
    """Ten minutes. ``ends``: how the moves ended, with how many of each; ``contacts`` as sentences; ``stuck``: which of
    the last goals were not reached though there was a way."""

    number: int
    seconds: float
    ends: dict[str, int]
    contacts: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    stuck: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Options:
    """``minutes`` of simulation. ``results``: the file that is written after each ten and from which a run goes on."""

    minutes: int = MINUTES
    results: Path = Path("random-goals-results.jsonl")


def run(options: Options | None = None) -> Report:
    chosen = options or Options()
    done = read(chosen.results)
    console = Console(stderr=True)
    numbers = range(math.ceil(chosen.minutes / PART))
    for number in track([n for n in numbers if n not in done], "random goals", console=console):
        done[number] = drive(number)
        with chosen.results.open("a") as file:
            file.write(json.dumps(asdict(done[number])) + "\n")
        console.print(done[number])
    return report([done[number] for number in numbers])


def read(file: Path) -> dict[int, Part]:
    """What was driven before, by number."""
    lines = file.read_text().splitlines() if file.exists() else []
    return {part.number: part for part in (Part(**json.loads(line)) for line in lines if line)}


def drive(number: int, minutes: float = PART, last_goals: int = LAST_GOALS) -> Part:
    """The ten minutes of that number, always the same; then goals that must be reached."""
    rng = random.Random(f"random goals {number}")
    with (
        tempfile.TemporaryDirectory() as folder,
        JoinedWorld("warehouse", Path(folder), number, with_arms=False) as world,
    ):
        chassis, crates, moves, contacts = world.chassis(), Crates(), list[int](), list[str]()
        for _ in range(round(60 * minutes / PERIOD)):
            change_crates(world, crates, rng)
            moves.append(chassis.post(standard(rng.uniform(0, 20), rng.uniform(0, 14), rng.uniform(-math.pi, math.pi))))
            for _ in range(round(PERIOD / STEP)):
                world.advance(STEP)
                contacts += robots_contacts(world)
        stuck = []
        for x, y, yaw in islice(free_goals(standing(world, crates), rng), last_goals):
            here = world.true_pose("amr1")
            way = there_is_a_way((here.x, here.y), (x, y), standing(world, crates))
            moves.append(chassis.post(standard(x, y, yaw)))
            ended = chassis.finish(moves[-1], WITHIN)
            if way and (ended.state != "succeeded" or distance(world.true_pose("amr1"), x, y) > 0.1):
                stuck.append(f"({here.x:.2f}, {here.y:.2f}) to ({x:.2f}, {y:.2f}): {ended.fail_message or ended.state}")
        contacts += robots_contacts(world)
        ended = [chassis.move(move) for move in moves]
        names = Counter(MoveFailReason(m.fail_reason).rest_name if m.state == "failed" else str(m.state) for m in ended)
        errors = [f"move {m.id}: {m.fail_message}" for m in ended if m.fail_reason == MoveFailReason.INTERNAL_ERROR]
        return Part(number, round(world.now(), 1), dict(names.most_common()), contacts, errors, stuck)


# -- crates ----------------------------------------------------------------------------------------------------------


def change_crates(world: JoinedWorld, crates: Crates, rng: random.Random) -> None:
    """Perhaps place a crate somewhere, not on anybody, or take one away."""
    if rng.random() > CRATE_CHANCE:
        return
    if len(crates) == MOST_CRATES or (crates and rng.random() < 0.4):
        gone = rng.choice(sorted(crates))
        del crates[gone]
        world.ask(Remove(name=gone))
        return
    x, y, yaw = rng.uniform(0.5, 19.5), rng.uniform(0.5, 13.5), rng.uniform(-math.pi, math.pi)
    there = world.true_poses()
    keep = {"amr1": FROM_ROBOT, "anna": FROM_PERSON}
    if any(distance(pose, x, y) < keep.get(name, FROM_PERSON) for name, pose in there.items()):
        return
    name = next(name for k in range(MOST_CRATES) if (name := f"crate_{k}") not in crates)
    crates[name] = (x, y)
    world.ask(Place(name=name, pose=Pose2(x=x, y=y, yaw=yaw), size=CRATE))


def standing(world: JoinedWorld, crates: Mapping[str, Point]) -> dict[str, Point]:
    """Where racks and crates truly are."""
    return dict(crates) | {name: (p.x, p.y) for name, p in world.true_poses().items() if name.startswith("rack")}


def there_is_a_way(begin: Point, end: Point, things: Mapping[str, Point]) -> bool:
    """Whether a robot can get from one to the other in any heading, the person left aside."""
    ground, (left, lower) = allowed_ground()
    rows, columns = np.indices(ground.shape)
    for x, y in things.values():
        ground = ground & (np.hypot(left + (columns + 0.5) * CELL - x, lower + (rows + 0.5) * CELL - y) > 0.75)
    free = ndimage.distance_transform_edt(ground) * CELL > ROOM
    labels, _ = ndimage.label(free)
    cells = [(int((y - lower) / CELL), int((x - left) / CELL)) for x, y in (begin, end)]
    return bool(free[cells[1]]) and nearest_label(labels, cells[0]) == labels[cells[1]]


def nearest_label(labels: NDArray[np.int32], cell: tuple[int, int]) -> int:
    """The label of the free cell that is nearest."""
    nearest = ndimage.distance_transform_edt(labels == 0, return_distances=False, return_indices=True)
    return int(labels[tuple(nearest[:, cell[0], cell[1]])])


# -- contacts --------------------------------------------------------------------------------------------------------


def robots_contacts(world: JoinedWorld) -> list[str]:
    """Those since the last look that the robot caused, as sentences; what was recorded of the drive is then dropped."""
    chassis = world.chassis()
    speeds = {o.stamp: (o.twist.linear, o.twist.angular) for o in chassis.odometry}
    found = [c for c in world.inspect().contacts if c.stamp >= min(speeds, default=0) and is_robots(c, speeds)]
    chassis.odometry.clear()
    chassis.commands.clear()
    chassis.published.clear()
    return [f"{contact.other} at {contact.stamp / NANOSECONDS:.1f} s, {contact.force:.0f} N" for contact in found]


def is_robots(contact: Contact, speeds: Mapping[int, tuple[float, float]]) -> bool:
    """Whether the robot moved when it happened: a person who walks into a robot at rest is none of its contacts."""
    before = [speed for stamp, speed in speeds.items() if 0 <= contact.stamp - stamp < NANOSECONDS // 10]
    return any(max(abs(linear), abs(angular)) > AT_REST for linear, angular in before)


def report(parts: Sequence[Part]) -> Report:
    ends = Counter[str]()
    for part in parts:
        ends.update(part.ends)
    faults = [
        *(c for p in parts for c in p.contacts),
        *(e for p in parts for e in p.errors),
        *(s for p in parts for s in p.stuck),
    ]
    return Report(
        "Random goals, replaced every ten seconds",
        "python -m benchmarks random_goals",
        ("simulated h", "moves", "contacts by the robot", "internal errors", "stuck at the end", "ends"),
        [
            (
                f"{sum(part.seconds for part in parts) / 3600:.2f}",
                str(sum(ends.values())),
                str(sum(len(part.contacts) for part in parts)),
                str(sum(len(part.errors) for part in parts)),
                str(sum(len(part.stuck) for part in parts)),
                ", ".join(f"{count} {name}" for name, count in ends.most_common()),
            )
        ],
        f"World `warehouse` in physics: a person walks, up to {MOST_CRATES} crates of {CRATE[0]} x {CRATE[1]} m that "
        f"no map shows come and go. A goal every {PERIOD:.0f} s anywhere in the hall, in walls and racks, too. After "
        f"each {PART} minutes {LAST_GOALS} goals to which there is a way must be reached."
        + (f" Faults: {'; '.join(faults)}." if faults else ""),
    )
