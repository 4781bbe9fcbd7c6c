"""The demonstration with one seed after another, in lockstep, each run judged by the ground truth.

    python -m benchmarks demo --count 10

Seeds are 1 to ``count``. A run passes when the story is played to its end over the public APIs, each jar stands on the
table where it was meant to be, the rack is back at its point, nobody holds the arm, and nothing was touched.
"""

from __future__ import annotations

import io
import json
import math
import tempfile
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

from rich.console import Console

from benchmarks.progress import say, track
from benchmarks.report import Report, median
from rackhand.services.launch.demo import stage
from rackhand.services.launch.demo.console import Output
from rackhand.services.launch.demo.errors import StoryError
from rackhand.services.launch.demo.play import on_stage
from rackhand.services.launch.demo.stage import scene_of
from rackhand.services.launch.demo.story import ITEMS, RACK, STORY
from rackhand.testing import Cell, distance
from rackhand.worlds.world_model import load_world

WORLD, STORED = "warehouse", (7.8, 12.2)  # the rack's point, m
TABLE_TOP, HALF_JAR = 0.7, 0.06  # m above the floor; m
JAR_OFF, JAR_TILTED, RACK_OFF = 0.03, 0.005, 0.04  # m


@dataclass(frozen=True)
class Played:
    """One run. ``problems``: what was not as it should be, a sentence each; ``errors``: m of the jars, in their order,
    and of the rack; ``seconds`` of the robot's clock and ``wall`` of this machine's; ``printed``: by the story."""

    seed: int
    seconds: float
    wall: float
    problems: list[str]
    errors: list[float] = field(default_factory=list)
    printed: str = ""


@dataclass(frozen=True)
class Options:
    """``count`` of seeds. ``results``: the file that is written after each and from which a run goes on."""

    count: int = 10
    results: Path = Path("demo-results.jsonl")


def run(options: Options | None = None) -> Report:
    chosen = options or Options()
    lines = chosen.results.read_text().splitlines() if chosen.results.exists() else []
    done = {played.seed: played for played in (Played(**json.loads(line)) for line in lines)}
    seeds = range(1, chosen.count + 1)
    for seed in track([seed for seed in seeds if seed not in done], "demo"):
        with tempfile.TemporaryDirectory() as folder:
            done[seed] = played_with(seed, Path(folder))
        with chosen.results.open("a") as file:
            file.write(json.dumps(asdict(done[seed])) + "\n")
        say(f"seed {seed}: {'; '.join(done[seed].problems) or 'passed'}, {done[seed].wall:.0f} s")
    return report([done[seed] for seed in seeds])


def played_with(seed: int, folder: Path) -> Played:
    """The story in a cell of its own with this seed, in lockstep; ``folder``: of the cell."""
    printed, begun = io.StringIO(), time.monotonic()
    output = Output(Console(file=printed, width=120))
    problems, errors, seconds = list[str](), list[float](), 0.0
    with Cell(folder, seed=seed) as cell:
        with on_stage(cell, scene_of(load_world(WORLD)), output) as player:
            start = player.chassis.now()
            try:
                player.play(STORY)
                output.table()
                if (holder := player.arm.status()["priorityUnderControl"]) != 0:
                    problems.append(f"priority {holder} still holds the arm")
            except StoryError as error:
                problems.append(str(error))
            seconds = player.chassis.now() - start
        cell.pause()
        judged, errors = judge(cell)
        problems += judged
    return Played(seed, round(seconds, 1), round(time.monotonic() - begun, 1), problems, errors, printed.getvalue())


def judge(cell: Cell) -> tuple[list[str], list[float]]:
    """What the ground truth says of a cell in which the story was played: problems, and the errors of ``Played``."""
    things, problems, errors = cell.objects(), list[str](), list[float]()
    for name in ITEMS:
        x, y, z = things[name].position
        errors.append(round(math.dist((x, y), stage.TARGETS[name]), 4))
        above = z - TABLE_TOP - HALF_JAR
        if errors[-1] > JAR_OFF or abs(above) > JAR_TILTED:
            problems.append(
                f"{name} is {errors[-1]:.3f} m beside its place and {above:+.3f} m above the table, want at most "
                f"{JAR_OFF} m and {JAR_TILTED} m"
            )
    errors.append(round(distance(cell.true_pose(RACK), *STORED), 4))
    if errors[-1] > RACK_OFF:
        problems.append(f"{RACK} is {errors[-1]:.3f} m off its point, want at most {RACK_OFF} m")
    if contacts := cell.contacts():
        problems.append(f"{len(contacts)} contacts, with {', '.join(sorted({one.other for one in contacts}))}")
    return problems, errors


def report(runs: list[Played]) -> Report:
    passed = [played for played in runs if not played.problems]
    rows = [
        (
            str(played.seed),
            "; ".join(played.problems) or "passed",
            f"{played.seconds:.1f}",
            " ".join(f"{1e3 * error:.0f}" for error in played.errors[:-1]),
            f"{1e3 * played.errors[-1]:.0f}" if played.errors else "",
        )
        for played in runs
    ]
    return Report(
        "The demonstration",
        f"python -m benchmarks demo --count {len(runs)}",
        ("seed", "result", "robot's clock, s", "jars beside their places, mm", "rack off its point, mm"),
        rows,
        f"{len(passed)} of {len(runs)} seeds pass. Lockstep, the whole cell, public APIs only; judged by the ground "
        f"truth: each jar within {1e3 * JAR_OFF:.0f} mm of its place and standing, the rack within "
        f"{1e3 * RACK_OFF:.0f} mm of its point, no contact, the arm given back. Median wall time of a run here: "
        f"{median([one.wall for one in runs]):.0f} s.",
    )
