"""An hour of rack jobs at random, undisturbed and with whatever a client or an operator may do in between.

    python -m benchmarks rack_hour --variant interrupted --minutes 20

Each job is a line on standard error. Each 20 minutes are a world with a seed of their own, so that a run goes on where
it was stopped and any of them can be repeated alone; a run that is stopped prints the table of what it has done.
"""

from __future__ import annotations

import json
import math
import random
import signal
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from benchmarks.progress import say, update
from benchmarks.rack_jobs import OFF, TURNED, forbidden
from benchmarks.report import Report
from rackhand.schemas import topics
from rackhand.schemas.chassis import JackRequest, SetControlMode, SetEmergencyStop
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import PointType
from rackhand.schemas.moves import TERMINAL, Move
from rackhand.schemas.refusal import RequestRefused
from rackhand.services.planner.jacking import REACHED
from rackhand.services.planner.load import LoadState
from rackhand.services.planner.map.overlays import PointOfInterest
from rackhand.testing import turn
from rackhand.worlds.scatter import scattered
from rackhand.worlds.world_model import World, load_world
from tests.joined.chassis import JoinedChassis
from tests.joined.world import JoinedWorld

MINUTES, PART = 60, 20  # minutes of simulation: of a variant, and of one world
STEP = 0.2  # s between two looks of the client
BETWEEN = 25.0  # s on average between two interruptions
HELD = 3.0  # s of an emergency stop or of remote mode
STROKE = 30.0  # s that the client waits for the jack
TRIES = 6  # of one step of a job
ASIDE = (5.5, 7.5)  # where a replacing move goes
AT_POINT = (0.04, math.radians(1.5))  # of a rack that was put down, off its point

Interruption = Literal["cancel", "replace", "emergency stop", "remote mode", "planner restarted"]
INTERRUPTIONS: tuple[Interruption, ...] = ("cancel", "replace", "emergency stop", "remote mode", "planner restarted")
VARIANTS = {"undisturbed": (False, False), "interrupted": (True, False), "people": (True, True)}
# by name: whether clients and operators interrupt, whether a person walks


@dataclass
class Tally:
    """What happened in ``seconds``. ``ends``: of moves, by state and reason; ``unexplained``: ends without a reason or
    a text; ``misplaced``: racks and rack points that are not as the API says, as first seen; ``touched``: contacts."""

    seconds: float = 0.0
    jobs: int = 0
    given_up: list[str] = field(default_factory=list)
    ends: Counter[str] = field(default_factory=Counter)
    unexplained: list[str] = field(default_factory=list)
    interruptions: Counter[str] = field(default_factory=Counter)
    misplaced: dict[str, str] = field(default_factory=dict)
    touched: list[str] = field(default_factory=list)

    def faults(self) -> list[str]:
        return [*self.given_up, *self.unexplained, *self.misplaced.values(), *self.touched]


@dataclass(frozen=True)
class Options:
    """``minutes`` of simulation for the named ``variant``, or for each. ``results``: the file that is written after
    each world and from which a run goes on."""

    variant: str = ""
    minutes: int = MINUTES
    results: Path = Path("rack-hour-results.jsonl")


class _GivenUp(Exception):
    """A step of a job did not succeed in ``TRIES`` tries."""


def run(options: Options | None = None) -> Report:
    chosen = options or Options()
    done = read(chosen.results)
    variants = [chosen.variant] if chosen.variant else list(VARIANTS)
    numbers = range(math.ceil(chosen.minutes / PART))
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # in the background there is no Ctrl-C
    try:
        for variant, number in [(v, n) for v in variants for n in numbers if (v, n) not in done]:
            done[variant, number] = Tally()
            drive(variant, number, done[variant, number])
            write(chosen.results, variant, number, done[variant, number])
    except KeyboardInterrupt:
        say("stopped: the table is of what was done, the world that was stopped included")
    return report({v: [done[v, n] for n in numbers if (v, n) in done] for v in variants})


def write(file: Path, variant: str, number: int, tally: Tally) -> None:
    with file.open("a") as lines:
        lines.write(json.dumps({"variant": variant, "number": number, **vars(tally)}) + "\n")


def read(file: Path) -> dict[tuple[str, int], Tally]:
    """What was done before, by variant and number."""
    rows = [json.loads(line) for line in (file.read_text().splitlines() if file.exists() else []) if line]
    return {(row.pop("variant"), row.pop("number")): _tally(row) for row in rows}


def _tally(row: dict[str, Any]) -> Tally:
    return Tally(**row | {name: Counter(row[name]) for name in ("ends", "interruptions")})


def report(done: dict[str, list[Tally]]) -> Report:
    return Report(
        "An hour of rack jobs",
        "python -m benchmarks rack_hour",
        ("variant", "minutes", "jobs", "given up", "moves by end", "interruptions", "unexplained", "misplaced",
         "bad contacts"),
        [_row(variant, together(tallies)) for variant, tallies in done.items()],
        f"World `warehouse` in lockstep, worlds of {PART} min of simulation time, racks at first up to "
        f"{100 * OFF:.0f} cm and {math.degrees(TURNED):.0f}° off their points. A client that reads only the API "
        "carries racks from random points to random free points. Interruptions come at random every "
        f"{BETWEEN:.0f} s on average, in whatever stage the job is: {', '.join(INTERRUPTIONS)}; after each the client "
        "goes on from what the API says. Variant `people` is `interrupted` while a person walks through the hall. "
        "Unexplained: moves that failed without a reason and a text. Misplaced: racks that truly are more than "
        f"{1e3 * AT_POINT[0]:.0f} mm or {math.degrees(AT_POINT[1]):.1f}° from where they were put, or rack points "
        "whose state in the API is not the truth; looked at after each job.",
    )  # fmt: skip


def together(tallies: Sequence[Tally]) -> Tally:
    whole = Tally()
    for number, tally in enumerate(tallies):
        whole.seconds, whole.jobs = whole.seconds + tally.seconds, whole.jobs + tally.jobs
        whole.ends, whole.interruptions = whole.ends + tally.ends, whole.interruptions + tally.interruptions
        whole.given_up, whole.unexplained = whole.given_up + tally.given_up, whole.unexplained + tally.unexplained
        whole.touched = whole.touched + tally.touched
        whole.misplaced |= {f"{number} {what}": how for what, how in tally.misplaced.items()}
    return whole


def _row(name: str, tally: Tally) -> tuple[str, ...]:
    def listed(counter: Counter[str]) -> str:
        return ", ".join(f"{key} {count}" for key, count in sorted(counter.items())) or "none"

    def found(faults: Iterable[str]) -> str:
        return "; ".join(faults) or "none"

    return (
        name, f"{tally.seconds / 60:.0f}", str(tally.jobs), found(tally.given_up), listed(tally.ends),
        listed(tally.interruptions), found(tally.unexplained), found(tally.misplaced.values()), found(tally.touched),
    )  # fmt: skip


def drive(variant: str, number: int, tally: Tally, seconds: float = 60.0 * PART) -> None:
    """Random jobs in the world of that number, always the same; what happens is added to ``tally`` after each."""
    interrupted, people = VARIANTS[variant]
    whole = load_world("warehouse")
    changes: dict[str, Any] = {"arms": {}, "timestep": 0.002} | ({} if people else {"movers": {}})
    world = scattered(whole.model_copy(update=changes), number, OFF, TURNED)
    with tempfile.TemporaryDirectory() as folder, JoinedWorld(world, Path(folder), seed=number) as joined:
        joined.advance(0.4)
        client = Client(joined.chassis(), world, random.Random(f"{variant} {number}"), interrupted, tally)
        while joined.now() < seconds:
            before, begun = tally.faults(), joined.now()
            what = client.job()
            tally.seconds, tally.touched = joined.now(), forbidden(joined.inspect().touches, world)
            client.judge()
            found = "".join(f"; {fault}" for fault in tally.faults() if fault not in before)
            say(f"{variant} {number}, {begun:.0f} to {joined.now():.0f} s: {what}{found}")
            update(f"{variant} {number}: simulated seconds of rack jobs", round(joined.now()), round(seconds))


class Client:
    """A client of the API with a list of which rack is at which point."""

    def __init__(
        self, driver: JoinedChassis, world: World, chance: random.Random, interrupted: bool, tally: Tally
    ) -> None:
        self.tally = tally
        self._driver, self._chance, self._interrupted = driver, chance, interrupted
        costmap = driver.core._motion.perception.costmap
        assert costmap is not None
        points = costmap.static.overlays.points_of(PointType.RACK)
        self._points = {point.name: point for point in points}
        self._stock = {
            min(points, key=lambda p: math.hypot(p.x - rack.pose[0], p.y - rack.pose[1])).name: name
            for name, rack in world.racks.items()
        }
        self._carried: str | None = None
        self._moved: set[str] = set()
        self._next = self._draw()

    def job(self) -> str:
        """One rack from its point to a free one, or the one that a job which was given up left on the jack; which."""
        source = self._chance.choice(sorted(self._stock))
        goal = self._chance.choice(sorted(set(self._points) - set(self._stock)))
        what = f"{source} to {goal}" if self._carried is None else f"{self._carried} to {goal}"
        try:
            if self._carried is None:
                self._until(
                    lambda: self._load() is LoadState.CARRYING, lambda: self._fetch(self._points[source]), source
                )
                self._carried = self._stock.pop(source)
                self._moved.add(self._carried)
            self._until(None, lambda: self._carry(self._points[goal]), goal)
            self._until(lambda: self._load() is not LoadState.CARRYING, lambda: self._jack("down"), goal)
            self._stock[goal], self._carried = self._carried, None
            self._until(lambda: self._load() is LoadState.FREE, self._leave, goal)
            self.tally.jobs += 1
        except _GivenUp as why:
            self.tally.given_up.append(str(why))
        return what

    def judge(self) -> None:
        """Racks and rack points against the truth."""
        poses = self._driver.world.true_poses()
        for name, rack in self._stock.items():
            point, true = self._points[name], poses[rack]
            away, turned = math.hypot(point.x - true.x, point.y - true.y), abs(turn(true.yaw, point.yaw or 0.0))
            bound = AT_POINT if rack in self._moved else (2 * OFF, 2 * TURNED)
            if away > bound[0] or turned > bound[1]:
                self._misplaced(rack, f"{1e3 * away:.0f} mm, {math.degrees(turned):.1f}° off {name}")
        states = {point.poi_id: point.levels[0].state for point in self._driver.newest(topics.MAP_RACK_STATES).racks}
        for name, point in self._points.items():
            state, true_state = states.get(point.id, "unknown"), "occupied" if name in self._stock else "free"
            if state not in ("unknown", true_state):
                self._misplaced(name, f"{true_state}, the API says {state}")

    def _misplaced(self, what: str, how: str) -> None:
        self.tally.misplaced.setdefault(what, f"{what} {how} at {self._driver.world.now():.0f} s")

    # -- steps of a job ----------------------------------------------------------------------------------------------

    def _until(self, done: Callable[[], bool] | None, step: Callable[[], bool], where: str) -> None:
        """Take the step until it succeeded, or ``done`` says so."""
        for _ in range(TRIES):
            if step() and (done is None or done()):
                return
            if done is not None and done():
                return
        last = self._driver.core._book.last
        raise _GivenUp(f"at {where}, {self._driver.world.now():.0f} s: {last.type if last else ''} "
                       f"{last.state if last else ''} {last.fail_message if last else ''}")  # fmt: skip

    def _fetch(self, point: PointOfInterest) -> bool:
        if self._progress() <= REACHED and not self._move(type="align_with_rack", target_x=point.x, target_y=point.y):
            return False
        return self._jack("up")

    def _carry(self, point: PointOfInterest) -> bool:
        return self._move(type="to_unload_point", target_x=point.x, target_y=point.y)

    def _leave(self) -> bool:
        return self._move(type="standard", target_x=ASIDE[0], target_y=ASIDE[1])

    def _jack(self, direction: Literal["up", "down"]) -> bool:
        self._order(lambda: self._driver.ask(JackRequest(direction=direction)))
        wanted = 1.0 if direction == "up" else 0.0
        return self._wait(lambda: abs(self._progress() - wanted) <= REACHED or None, STROKE) is not None

    def _move(self, **body: Any) -> bool:
        """Whether it succeeded."""
        id_ = self._order(lambda: self._driver.post(body))
        if id_ is None:
            return False
        ended = self._wait(lambda: move if (move := self._driver.move(id_)).state in TERMINAL else None, 400.0)
        if ended is None:
            raise _GivenUp(f"{body}: no end in 400 s")
        self._note(ended)
        return bool(ended.state == "succeeded")

    def _note(self, move: Move) -> None:
        reason = MoveFailReason(move.fail_reason)
        self.tally.ends[move.state if not reason else f"{move.state} {int(reason)}"] += 1
        if move.state == "failed" and (not reason or not move.fail_message):
            self.tally.unexplained.append(f"{move.type} {move.id}")

    def _order(self, order: Callable[[], Any]) -> Any:
        """The answer; None where it is refused for now, after a moment."""
        try:
            return order()
        except RequestRefused:
            self._driver.world.advance(2.0)
            return None

    def _wait(self, found: Callable[[], Any], within: float) -> Any:
        end = self._driver.world.now() + within
        while (value := found()) is None and self._driver.world.now() < end:
            self._driver.world.advance(STEP)
            if self._interrupted and self._driver.world.now() >= self._next:
                self._interrupt(self._chance.choice(INTERRUPTIONS))
        return value

    def _load(self) -> LoadState:
        return LoadState(self._driver.newest(topics.LOAD).state)

    def _progress(self) -> float:
        jack = self._driver.core._state.jack
        return 0.0 if jack is None else jack.progress

    # -- interruptions -----------------------------------------------------------------------------------------------

    def _draw(self) -> float:
        return self._driver.world.now() + self._chance.expovariate(1.0 / BETWEEN)

    def _interrupt(self, kind: Interruption) -> None:
        driver = self._driver
        self._next = math.inf  # one at a time
        self.tally.interruptions[kind] += 1
        match kind:
            case "cancel":
                self._order(driver.cancel)
            case "replace":
                self._move(type="standard", target_x=ASIDE[0], target_y=ASIDE[1])
            case "emergency stop":
                driver.ask(SetEmergencyStop(enable=True))
                driver.world.advance(HELD)
                driver.ask(SetEmergencyStop(enable=False))
            case "remote mode":
                driver.ask(SetControlMode(control_mode="remote"))
                driver.world.advance(HELD)
                driver.ask(SetControlMode(control_mode="auto"))
            case "planner restarted":
                driver.restart()
        self._next = self._draw()
