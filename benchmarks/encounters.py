"""A robot and a person who meet: 200 seeded encounters in a hall and in a corridor, in physics.

    python -m benchmarks encounters --count 20

People walk on scripts and do not evade; they stop for what is right in front of them. Each encounter is a world of its
own in lockstep, so that any of them can be repeated alone.
"""

from __future__ import annotations

import json
import math
import random
import statistics
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import pytest

from benchmarks.progress import say, track
from benchmarks.report import Report, percentile
from rackhand.schemas.base import NANOSECONDS, Pose2
from rackhand.schemas.moves import TERMINAL
from rackhand.schemas.world import Place, Remove
from rackhand.worlds.chassis_model import load_profile
from tests.joined.places import write_place
from tests.joined.world import JoinedWorld

Kind = Literal["crossing", "oncoming", "overtaking", "overtaken"]
Ground = Literal["open", "corridor"]

COUNT, SEED = 200, 19
KINDS: tuple[Kind, ...] = ("crossing", "oncoming", "overtaking", "overtaken")
GROUNDS: tuple[Ground, ...] = ("open", "corridor")
START, GOAL = -8.0, 8.0  # m along x, at y = 0
PERSON = (0.25, 1.7)  # m, radius and height
NEAREST_START = 2.5  # m from the person's start to the robot's
SLOWEST, FASTEST = 0.4, 1.4  # m/s of people
CRUISE, RAMP = 1.15, 1.3  # m/s, and s lost by speeding up: when the robot is about where
OFF_TIME = 1.5  # s at most, by which a person comes to the robot's path sooner or later than the robot does
HALF_CORRIDOR, DOOR = 1.2, 0.8  # m from its middle to its walls; from the middle of its doorways to their posts
LIMIT = 180.0  # s for a move
STEP = 0.1  # s between two looks
ARRIVING = 0.3  # m from the goal, where the robot stops and turns to its heading
AT_REST, STOPPED_FOR = 0.05, 0.3  # m/s and s: a stop
HALF_LENGTH, HALF_WIDTH = load_profile("longjack").footprint.max(axis=0)  # m, of a rectangle about the origin
DRIVEN_INTO = 0.05  # m/s of the robot towards the person, above which a contact is the robot's


@dataclass(frozen=True)
class Encounter:
    """A person who leaves ``begin`` for ``end`` (m) at ``speed`` (m/s), ``delay`` seconds after the request."""

    number: int
    ground: Ground
    kind: Kind
    speed: float
    begin: tuple[float, float]
    end: tuple[float, float]
    delay: float


@dataclass(frozen=True)
class Outcome:
    """How one ended. ``lost`` in s against the empty ground; ``nearest`` in m between body and person; ``caused``:
    contacts of a robot that drove towards the person, of ``contacts``."""

    number: int
    ground: Ground
    kind: Kind
    speed: float
    state: str
    lost: float
    nearest: float
    stops: int
    contacts: int
    caused: int
    why: str = ""


@dataclass(frozen=True)
class Options:
    """``count``: how many of the encounters, from the first on. ``results``: the file that is written after each and
    from which a run goes on."""

    count: int = COUNT
    results: Path = Path("encounters-results.jsonl")


def run(options: Options | None = None) -> Report:
    chosen = options or Options()
    done = read(chosen.results)
    empty: dict[Ground, float] = {}
    for number in track([n for n in range(chosen.count) if n not in done], "encounters"):
        encounter = encounter_of(number)
        if encounter.ground not in empty:
            empty[encounter.ground] = time_alone(encounter.ground)
        done[number] = meet(encounter, empty[encounter.ground])
        with chosen.results.open("a") as file:
            file.write(json.dumps(asdict(done[number])) + "\n")
        say(sentence(done[number]))
    return report([done[number] for number in range(chosen.count)])


def read(file: Path) -> dict[int, Outcome]:
    """What was driven before, by number."""
    lines = file.read_text().splitlines() if file.exists() else []
    return {outcome.number: outcome for outcome in (Outcome(**json.loads(line)) for line in lines if line)}


def sentence(outcome: Outcome) -> str:
    return (
        f"{outcome.number} {outcome.ground} {outcome.kind} at {outcome.speed:.2f} m/s: {outcome.state}, lost "
        f"{outcome.lost:.1f} s, nearest {outcome.nearest:.2f} m, {outcome.stops} stops, {outcome.contacts} contacts of "
        f"which {outcome.caused} by the robot {outcome.why}"
    )


# -- what happens -----------------------------------------------------------------------------------------------------


def encounter_of(number: int) -> Encounter:
    """The encounter of that number, always the same."""
    rng = random.Random(f"{SEED}/{number}")
    kind, ground = KINDS[number % len(KINDS)], GROUNDS[number // len(KINDS) % len(GROUNDS)]
    made = {"crossing": _crossing, "oncoming": _oncoming, "overtaking": _overtaking, "overtaken": _overtaken}
    speed, begin, end, delay = made[kind](rng, ground)
    return Encounter(number, ground, kind, round(speed, 2), begin, end, max(0.0, round(delay, 2)))


Script = tuple[float, tuple[float, float], tuple[float, float], float]


def _arrival(x: float) -> float:
    """Seconds until a robot that nothing holds up is at ``x``."""
    return (x - START) / CRUISE + RAMP


def _crossing(rng: random.Random, ground: Ground) -> Script:
    """Across the robot's path as it comes; in the corridor from one doorway into the other."""
    speed, side, meeting = rng.uniform(SLOWEST, FASTEST), rng.choice((-1.0, 1.0)), rng.uniform(-3.0, 4.0)
    angle = rng.uniform(math.radians(50), math.radians(130))
    if ground == "corridor":
        meeting, angle = rng.uniform(-0.3, 0.3), math.radians(90)
    away = rng.uniform(3.0, 7.0)
    dx, dy = away * math.cos(angle), side * away * math.sin(angle)
    delay = _arrival(meeting) + rng.uniform(-OFF_TIME, OFF_TIME) - away / speed
    return speed, (meeting - dx, -dy), (meeting + dx, dy), delay


def _oncoming(rng: random.Random, ground: Ground) -> Script:
    """Towards the robot, more or less on its line."""
    speed, meeting, beside = rng.uniform(SLOWEST, FASTEST), rng.uniform(-3.0, 3.0), _beside(rng, ground)
    away = min(speed * _arrival(meeting), GOAL + 3.0 - meeting)
    return speed, (meeting + away, beside), (START - 3.0, _beside(rng, ground)), _arrival(meeting) - away / speed


def _overtaking(rng: random.Random, ground: Ground) -> Script:
    """A fast person passes the robot from behind."""
    speed, beside = rng.uniform(1.25, FASTEST), _beside(rng, ground)
    return speed, (START - rng.uniform(NEAREST_START, 3.0), beside), (GOAL + 3.0, _beside(rng, ground)), 0.0


def _overtaken(rng: random.Random, ground: Ground) -> Script:
    """A slow person goes ahead of the robot, in its direction."""
    speed, beside = rng.uniform(SLOWEST, 0.8), _beside(rng, ground)
    return speed, (START + rng.uniform(NEAREST_START, 5.0), beside), (GOAL + 3.0, _beside(rng, ground)), 0.0


def _beside(rng: random.Random, ground: Ground) -> float:
    widest = HALF_CORRIDOR - 0.4 if ground == "corridor" else 1.0
    return rng.uniform(-widest, widest)


# -- where ------------------------------------------------------------------------------------------------------------


def open_ground(ground: Ground, folder: Path, seed: int = 0) -> JoinedWorld:
    """The joined world of that ground, its robot at the start."""
    with pytest.MonkeyPatch.context() as environment:
        write_place(folder, environment, ground, (-13.0, -9.0, 13.0, 9.0), _statics(ground), (START, 0.0, 0.0))
        return JoinedWorld(ground, folder, seed=seed)


def _statics(ground: Ground) -> dict[str, Any]:
    """Walls round the hall; in the corridor's case its walls, too, with two doorways across from each other."""
    corners = ((-13.0, -9.0), (13.0, -9.0), (13.0, 9.0), (-13.0, 9.0), (-13.0, -9.0))
    lines = list(pairwise(corners))
    if ground == "corridor":
        for y in (-HALF_CORRIDOR - 0.05, HALF_CORRIDOR + 0.05):
            lines += [((-13.0, y), (-DOOR, y)), ((DOOR, y), (13.0, y))]
    return {f"wall_{k}": {"kind": "wall", "start": list(a), "end": list(b)} for k, (a, b) in enumerate(lines)}


# -- how it ends ------------------------------------------------------------------------------------------------------


def time_alone(ground: Ground) -> float:
    """Seconds from start to goal with nobody there."""
    with tempfile.TemporaryDirectory() as folder, open_ground(ground, Path(folder)) as world:
        begun = world.now()
        move = world.chassis().drive(type="standard", target_x=GOAL, target_y=0.0, target_ori=0.0)
        if move.state != "succeeded":
            raise RuntimeError(f"{ground}, nobody there: {move.state}, {move.fail_message}")
        return world.now() - begun


def meet(encounter: Encounter, alone: float) -> Outcome:
    """Let it happen. ``alone``: seconds that the same move takes with nobody there."""
    with (
        tempfile.TemporaryDirectory() as folder,
        open_ground(encounter.ground, Path(folder), encounter.number) as world,
    ):
        here, person = encounter.begin, "person"
        world.ask(Place(name=person, kind="person", pose=_pose(here), size=PERSON))
        world.advance(1.0)
        begun, walking = world.now(), False
        move = world.chassis().post(type="standard", target_x=GOAL, target_y=0.0, target_ori=0.0)
        trail: list[Seen] = []
        while world.chassis().move(move).state not in TERMINAL and world.now() - begun < LIMIT:
            if not walking and world.now() - begun >= encounter.delay:
                walking = True
                walk = (_pose(encounter.begin), _pose(encounter.end))
                world.ask(
                    Place(name=person, kind="person", pose=walk[0], size=PERSON, walk=walk, speed=encounter.speed)
                )
            world.advance(STEP)
            there = world.true_poses()
            trail.append(Seen(world.now(), there["amr1"], there.get(person)))
            if person in there and math.dist((there[person].x, there[person].y), encounter.end) < 0.2:
                world.ask(Remove(name=person))
        ended, taken = world.chassis().move(move), world.now() - begun
        touched = [contact.stamp / NANOSECONDS for contact in world.inspect().contacts]
        e = encounter
        return Outcome(
            e.number, e.ground, e.kind, e.speed, str(ended.state), round(taken - alone, 1),
            round(min(seen.gap for seen in trail), 3), stops(trail), len(touched),
            sum(closing_speed(trail, time) > DRIVEN_INTO for time in touched), ended.fail_message,
        )  # fmt: skip


def _pose(point: tuple[float, float]) -> Pose2:
    return Pose2(x=point[0], y=point[1], yaw=0.0)


@dataclass(frozen=True)
class Seen:
    """Ground truth at one time (s)."""

    time: float
    robot: Pose2
    person: Pose2 | None

    @property
    def gap(self) -> float:
        """Metres between the robot's outline and a circle of the person's greatest radius, below 0 when they overlap;
        infinite when the person has left. The planner's own distances are not asked: they err on the safe side beyond a
        corner, and what drives is not to judge how it drove."""
        if self.person is None:
            return math.inf
        dx, dy = self.person.x - self.robot.x, self.person.y - self.robot.y
        c, s = math.cos(self.robot.yaw), math.sin(self.robot.yaw)
        ahead, beside = abs(c * dx + s * dy) - HALF_LENGTH, abs(c * dy - s * dx) - HALF_WIDTH
        return math.hypot(max(ahead, 0.0), max(beside, 0.0)) - PERSON[0]


def stops(trail: Sequence[Seen]) -> int:
    """How often the robot stood still between its first motion and its arrival."""
    under_way = [seen for seen in trail if seen.robot.x < GOAL - ARRIVING]
    speeds = [
        math.hypot(b.robot.x - a.robot.x, b.robot.y - a.robot.y) / (b.time - a.time)
        + abs(math.remainder(b.robot.yaw - a.robot.yaw, math.tau)) / (b.time - a.time)
        for a, b in pairwise(under_way)
    ]
    driven = [k for k, speed in enumerate(speeds) if speed > AT_REST]
    return sum((b - a - 1) * STEP >= STOPPED_FOR - 1e-9 for a, b in pairwise(driven))


def closing_speed(trail: Sequence[Seen], time: float) -> float:
    """m/s of the robot's middle towards the person in the look before ``time``; 0 if the person was not there."""
    k = next((k for k, seen in enumerate(trail) if seen.time >= time), len(trail) - 1)
    before, after = trail[max(k - 1, 0)], trail[k]
    if before.person is None or after is before:
        return 0.0
    away = (before.person.x - before.robot.x, before.person.y - before.robot.y)
    moved = (after.robot.x - before.robot.x, after.robot.y - before.robot.y)
    return (away[0] * moved[0] + away[1] * moved[1]) / math.hypot(*away) / (after.time - before.time)


# -- the table --------------------------------------------------------------------------------------------------------


def report(outcomes: Sequence[Outcome]) -> Report:
    groups = [(f"{kind}, {ground}", kind, ground) for kind in KINDS for ground in GROUNDS]
    rows = [
        row(name, [o for o in outcomes if o.kind == kind and o.ground == ground])
        for name, kind, ground in groups
        if any(o.kind == kind and o.ground == ground for o in outcomes)
    ]
    return Report(
        "Encounters with people",
        "python -m benchmarks encounters",
        ("encounter", "reached", "contacts by the robot", "by the person", "s lost: median / p95 / worst",
         "nearest m: median / least", "stops a run"),
        [*rows, row("all", outcomes)],
        f"{len(outcomes)} seeded encounters of a robot that drives {GOAL - START:.0f} m with one person of "
        f"{SLOWEST} to {FASTEST} m/s, in a hall of 26 x 18 m and in a corridor of {2 * HALF_CORRIDOR} m, in physics. "
        "People walk on a script: they stop for a body within 0.5 m right before them and do not evade. A contact is "
        f"the robot's if it drove at more than {DRIVEN_INTO} m/s towards the person. Time is lost against the same "
        "move with nobody there. Contacts are those of the physics, in each of its steps. Nearest is measured apart "
        f"from them: of the body's outline to a circle of the person's greatest radius, each {STEP} s, by true poses.",
    )  # fmt: skip


def row(name: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    lost, nearest = [o.lost for o in outcomes], [o.nearest for o in outcomes]
    return (
        name,
        f"{sum(o.state == 'succeeded' for o in outcomes)} of {len(outcomes)}",
        str(sum(o.caused for o in outcomes)),
        str(sum(o.contacts - o.caused for o in outcomes)),
        f"{statistics.median(lost):.1f} / {percentile(lost, 0.95):.1f} / {max(lost):.1f}",
        f"{statistics.median(nearest):.2f} / {min(nearest):.2f}",
        f"{statistics.mean(o.stops for o in outcomes):.1f}",
    )
