"""BARN (Perille et al. 2020): 250 fields of cylinders that no map shows, driven through the public HTTP API.

    python -m benchmarks barn --worlds 25

Whole cells in lockstep, chassis ``jackal``, one set of parameters: the load of the machine changes nothing. With
``--in-process`` the same cores run in one process, without HTTP and without the start of a cell for each world.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import pytest

from benchmarks.barn.plot import plot
from benchmarks.barn.score import BEST, KINDS, TOP_SPEED, Result, cause, speed_kinds
from benchmarks.progress import say, track
from benchmarks.report import Report, Table, percentile
from rackhand.schemas.base import Pose2
from rackhand.schemas.moves import TERMINAL
from rackhand.schemas.world import WorldReply
from rackhand.services.sim.world.barn import write_barn_world
from rackhand.testing import Cell, Judge, distance
from rackhand.worlds.data import WORLDS_PATH
from rackhand.worlds.world_model import load_world
from tests.joined.chassis import JoinedChassis
from tests.joined.world import JoinedWorld
from tests.system.driving import Driver

DATA = Path(__file__).with_name("worlds.json")
ACCURACY = 0.5  # m of the zone that is asked for
STEP = 0.1  # s of simulation time between two looks
LOCALISED = 0.4  # s after which the planner of a new world has a pose and a scan
WORST = 12  # worlds in the table
PUBLISHED = (
    ("DWA, 2022", "0.159"), ("Nav2 MPPI (8 worlds)", "0.105"), ("LiCS-KI, winner of 2024", "0.489"),
    ("winner of 2026", "0.4975"),
)  # fmt: skip


@dataclass(frozen=True)
class Options:
    """``data``: the file of worlds. ``worlds``: how many of them, evenly spread; 0 for all. ``results``: the file that
    is written after each world and from which a run goes on. ``in_process``: simulator and planner in this process."""

    data: Path = DATA
    worlds: int = 0
    results: Path = Path("barn-results.jsonl")
    in_process: bool = False


def run(options: Options | None = None) -> Report:
    chosen = options or Options()
    numbers = spread(sorted(json.loads(chosen.data.read_text())["worlds"], key=int), chosen.worlds)
    done = read(chosen.results)
    drive = drive_in_process if chosen.in_process else drive_cell
    for number in track([n for n in numbers if n not in done], "BARN"):
        done[number] = drive(chosen.data, number)
        with chosen.results.open("a") as file:
            file.write(json.dumps(done[number].record()) + "\n")
        result = done[number]
        say(f"world {number}: {result.state}, AT/OT {result.ratio:.2f}, score {result.score:.3f}")
    results = [done[number] for number in numbers]
    chosen.results.with_suffix(".svg").write_text(plot(results))
    return report(results, chosen.in_process)


def spread(numbers: Sequence[str], count: int) -> list[str]:
    """``count`` of them, evenly spread; all for 0."""
    n = len(numbers)
    return list(numbers) if not 0 < count < n else [numbers[k * n // count] for k in range(count)]


def read(file: Path) -> dict[str, Result]:
    """What was driven before, by world."""
    if not file.exists():
        return {}
    results = [Result.of(json.loads(line)) for line in file.read_text().splitlines() if line]
    return {result.world: result for result in results}


def drive_cell(data: Path, number: str) -> Result:
    """One world in a cell of its own, over HTTP."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_barn_world(data, number, folder / f"barn_{number}")
        environment = {WORLDS_PATH: name}
        with (
            Cell(folder, world=f"barn_{number}", crf=False, environment=environment) as cell,
            Judge(cell.bus) as judge,
        ):
            driver = Driver(cell, judge)
            driver.wait_until_joined()
            judge.pause()
            try:
                return _drive(number, _task(folder / f"barn_{number}"), judge, driver)
            finally:
                driver.close()


def drive_in_process(data: Path, number: str) -> Result:
    """One world in this process."""
    with tempfile.TemporaryDirectory() as name, pytest.MonkeyPatch.context() as patch:
        folder = Path(name)
        write_barn_world(data, number, folder / f"barn_{number}")
        patch.setenv(WORLDS_PATH, name)
        with JoinedWorld(f"barn_{number}", folder) as world:
            world.advance(LOCALISED)
            return _drive(number, _task(folder / f"barn_{number}"), world, _InProcess(world.chassis()))


class _World(Protocol):
    """What a run is judged by."""

    def now(self) -> float: ...
    def advance(self, seconds: float) -> object: ...
    def true_pose(self, name: str) -> Pose2: ...
    def inspect(self) -> WorldReply: ...


class _Client(Protocol):
    """What a run is driven by."""

    def post(self, body: dict[str, Any]) -> int: ...
    def move(self, move: int) -> dict[str, Any]: ...


@dataclass(frozen=True)
class _InProcess:
    """A client of a planner core that answers as the gateway does."""

    chassis: JoinedChassis

    def post(self, body: dict[str, Any]) -> int:
        return self.chassis.post(body)

    def move(self, move: int) -> dict[str, Any]:
        return self.chassis.move(move).model_dump()


def _task(folder: Path) -> tuple[float, float, float, float]:
    """Goal x, y in m, length of the organisers' path in m, time limit in s."""
    world = load_world(os.fspath(folder))
    assert world.task is not None
    return *world.task.goal, world.task.path_length, world.task.timeout


def _drive(number: str, task: tuple[float, float, float, float], world: _World, client: _Client) -> Result:
    x, y, length, timeout = task
    body = {"type": "standard", "target_x": x, "target_y": y, "target_accuracy": ACCURACY, "use_target_zone": True}
    move = client.post({"creator": "barn", **body})
    begun, path = world.now(), []
    while True:
        world.advance(STEP)
        pose, now, contacts = world.true_pose("amr1"), world.now() - begun, world.inspect().contact_count
        path.append((pose.x, pose.y))
        state = client.move(move)
        if contacts or state["state"] in TERMINAL or now > timeout:
            ended = "time limit" if now > timeout else str(state["state"])
            return Result(
                number, ended, round(now, 3), length / TOP_SPEED, round(distance(pose, x, y), 3), contacts,
                speed_kinds(path, STEP), str(state["fail_message"]),
            )  # fmt: skip


def report(results: Sequence[Result], in_process: bool = False) -> Report:
    how = (
        "simulator and planner in lockstep in one process, moves"
        if in_process
        else "whole cells in lockstep, `POST /chassis/moves`"
    )
    scores, ratios = [r.score for r in results], [r.ratio for r in results if r.succeeded]
    succeeded = sum(r.succeeded for r in results)
    lost = Counter[str]()
    for result in results:
        lost[cause(result)] += BEST - result.score
    own = [
        "rackhand", f"{statistics.mean(scores):.4f}", f"{100 * succeeded / len(results):.1f} %",
        f"{sum(r.contacts > 0 for r in results)}",
        f"{statistics.median(ratios):.2f} / {percentile(ratios, 0.95):.2f} / {max(ratios):.2f}" if ratios else "",
    ]  # fmt: skip
    total = sum(lost.values())
    worst = sorted(results, key=lambda r: (r.score, -r.ratio))[:WORST]
    return Report(
        "BARN",
        f"python -m benchmarks barn{' --in-process' if in_process else ''}",
        ("", f"score of {BEST}", "success", "runs with contact", "AT/OT median / p95 / max"),
        [own, *([name, score, "", "", ""] for name, score in PUBLISHED)],
        f"{len(results)} worlds, one run each, {how} (standard, a zone of "
        f"{ACCURACY} m), chassis `jackal`, one set of parameters. Score: success · OT / clip(AT, 2·OT, 8·OT), OT = "
        f"length of the path / {TOP_SPEED} m/s. The published rows are of other worlds, in Gazebo or on robots.",
        (
            Table(
                "Where the score is lost",
                ("by", "worlds", "score lost on average of all worlds"),
                [
                    [name, str(sum(cause(r) == name for r in results)), f"{share / len(results):.4f}"]
                    for name, share in lost.most_common()
                    if name
                ]
                if total > 1e-9
                else [["nothing", "0", "0"]],
            ),
            Table(
                "The worst worlds",
                ("world", "end", "score", "AT/OT", *(f"s {kind}" for kind in KINDS), "why"),
                [
                    [r.world, r.state, f"{r.score:.3f}", f"{r.ratio:.2f}", *(f"{s:.1f}" for s in r.seconds), r.why]
                    for r in worst
                    if not math.isclose(r.score, BEST)
                ],
            ),
        ),
    )
