"""An hour of rack jobs at random, undisturbed and with whatever a client or an operator may do in between."""

from __future__ import annotations

import math
import random
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from benchmarks.progress import update
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

HOUR = 3600.0
STEP = 0.2  # s between two looks of the client
BETWEEN = 25.0  # s on average between two interruptions
HELD = 3.0  # s of an emergency stop or of remote mode
STROKE = 30.0  # s that the client waits for the jack
TRIES = 6  # of one step of a job
ASIDE = (5.5, 7.5)  # where a replacing move goes
AT_POINT = (0.04, math.radians(1.5))  # of a rack that was put down, off its point

Interruption = Literal["cancel", "replace", "emergency stop", "remote mode", "planner restarted"]
VARIANTS = (("undisturbed", False, False), ("interrupted", True, False), ("interrupted, a person walks", True, True))
INTERRUPTIONS: tuple[Interruption, ...] = ("cancel", "replace", "emergency stop", "remote mode", "planner restarted")


@dataclass
class Tally:
    """What happened. ``ends``: of moves, by state and reason; ``unexplained``: ends without a reason or a text."""

    jobs: int = 0
    given_up: list[str] = field(default_factory=list)
    ends: Counter[str] = field(default_factory=Counter)
    unexplained: list[str] = field(default_factory=list)
    interruptions: Counter[str] = field(default_factory=Counter)
    misplaced: list[str] = field(default_factory=list)
    touched: list[str] = field(default_factory=list)


class _GivenUp(Exception):
    """A step of a job did not succeed in ``TRIES`` tries."""


def run(seconds: float = HOUR) -> Report:
    rows = [_row(name, drive(seconds, seed, *how)) for seed, (name, *how) in enumerate(VARIANTS)]
    return Report(
        "An hour of rack jobs",
        "python -m benchmarks rack_hour",
        ("variant", "jobs", "given up", "moves by end", "interruptions", "unexplained", "misplaced", "bad contacts"),
        rows,
        f"World `warehouse` in lockstep, {seconds:.0f} s of simulation time each, racks at first up to "
        f"{100 * OFF:.0f} cm and {math.degrees(TURNED):.0f}° off their points. A client that reads only the API "
        "carries racks from random points to random free points. Interruptions come at random every "
        f"{BETWEEN:.0f} s on average, in whatever stage the job is: {', '.join(INTERRUPTIONS)}; after each the client "
        "goes on from what the API says. Unexplained: moves that failed without a reason and a text. Misplaced: "
        f"racks that truly are more than {1e3 * AT_POINT[0]:.0f} mm or {math.degrees(AT_POINT[1]):.1f}° from where "
        "they were put, or rack points whose state in the API is not the truth.",
    )


def _row(name: str, tally: Tally) -> tuple[str, ...]:
    def listed(counter: Counter[str]) -> str:
        return ", ".join(f"{key} {count}" for key, count in sorted(counter.items())) or "none"

    def found(faults: list[str]) -> str:
        return "; ".join(faults) or "none"

    return (
        name, str(tally.jobs), found(tally.given_up), listed(tally.ends), listed(tally.interruptions),
        found(tally.unexplained), found(tally.misplaced), found(tally.touched),
    )  # fmt: skip


def drive(seconds: float, seed: int, interrupted: bool, people: bool) -> Tally:
    """So many seconds of random jobs."""
    whole = load_world("warehouse")
    changes: dict[str, Any] = {"arms": {}, "timestep": 0.002} | ({} if people else {"movers": {}})
    world = scattered(whole.model_copy(update=changes), seed, OFF, TURNED)
    with tempfile.TemporaryDirectory() as folder, JoinedWorld(world, Path(folder), seed=seed) as joined:
        joined.advance(0.4)
        client = Client(joined.chassis(), world, random.Random(seed), interrupted)
        while joined.now() < seconds:
            client.job()
            update("simulated seconds of rack jobs", round(joined.now()), round(seconds))
        client.judge()
        client.tally.touched = forbidden(joined.inspect().touches, world)
    return client.tally


class Client:
    """A client of the API with a list of which rack is at which point."""

    def __init__(self, driver: JoinedChassis, world: World, chance: random.Random, interrupted: bool) -> None:
        self.tally = Tally()
        self._driver, self._chance, self._interrupted = driver, chance, interrupted
        costmap = driver.core._motion.perception.costmap
        assert costmap is not None
        points = costmap.static.overlays.points_of(PointType.RACK)
        self._points = {point.name: point for point in points}
        self._stock = {
            min(points, key=lambda p: math.hypot(p.x - rack.pose[0], p.y - rack.pose[1])).name: name
            for name, rack in world.racks.items()
        }
        self._moved: set[str] = set()
        self._next = self._draw()

    def job(self) -> None:
        """One rack from its point to a free one."""
        source = self._chance.choice(sorted(self._stock))
        goal = self._chance.choice(sorted(set(self._points) - set(self._stock)))
        try:
            self._until(lambda: self._load() is LoadState.CARRYING, lambda: self._fetch(self._points[source]), source)
            rack = self._stock.pop(source)
            self._until(None, lambda: self._carry(self._points[goal]), goal)
            self._stock[goal] = rack
            self._moved.add(rack)
            self._until(lambda: self._load() is not LoadState.CARRYING, lambda: self._jack("down"), goal)
            self._until(lambda: self._load() is LoadState.FREE, self._leave, goal)
            self.tally.jobs += 1
        except _GivenUp as why:
            self.tally.given_up.append(str(why))

    def judge(self) -> None:
        """Racks and rack points against the truth."""
        poses = self._driver.world.true_poses()
        for name, rack in self._stock.items():
            point, true = self._points[name], poses[rack]
            away, turned = math.hypot(point.x - true.x, point.y - true.y), abs(turn(true.yaw, point.yaw or 0.0))
            bound = AT_POINT if rack in self._moved else (2 * OFF, 2 * TURNED)
            if away > bound[0] or turned > bound[1]:
                self.tally.misplaced.append(f"{rack} {1e3 * away:.0f} mm, {math.degrees(turned):.1f}° off {name}")
        states = {point.poi_id: point.levels[0].state for point in self._driver.newest(topics.MAP_RACK_STATES).racks}
        for name, point in self._points.items():
            state, true_state = states.get(point.id, "unknown"), "occupied" if name in self._stock else "free"
            if state not in ("unknown", true_state):
                self.tally.misplaced.append(f"{name} is {true_state}, the API says {state}")

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
