"""Runs one scenario in a cell that is up, paused and in lockstep."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from typing import Protocol

from rackhand.bus import BusError, Refused
from rackhand.scenarios.api import Api, ApiError
from rackhand.scenarios.maps import Maps
from rackhand.scenarios.verdicts import Json, Outcome, Verdict, judge
from rackhand.schemas.base import NANOSECONDS, Message, Pose2
from rackhand.schemas.moves import TERMINAL
from rackhand.schemas.world import (
    Advance,
    InjectFault,
    Inspect,
    MoveObject,
    MoveRobot,
    Pause,
    Place,
    Push,
    Remove,
    Reset,
    Restore,
    WorldReply,
)
from rackhand.worlds.data import PoseTuple
from rackhand.worlds.scenario_model import Condition, Fault, Obstacle, Scenario, Step

STEP = 0.2  # s of simulation time between two looks
SETTLE = 0.5  # s for which sensors see the world as it was set up
GRACE = 2.0  # s beyond what is expected, after which a move counts as not ended
JACK_STROKE = 30.0  # s within which the jack must have arrived
RECOVERY = 120.0  # s within which the move after a failure must have succeeded
JOINING = 60.0  # s of wall time for the planner to join a run


class Cell(Protocol):
    """What a scenario needs of the cell that it runs in."""

    http: str

    def ask(self, request: Message, timeout: float = 60.0) -> WorldReply: ...

    def true_pose(self, name: str) -> Pose2: ...

    def use_no_map(self, robot: str) -> None:
        """Let that robot's planner use no map, which no request over HTTP can."""

    def ask_lift(self, lift: str, fields: Json) -> None:
        """One of the requests of ``rackhand.schemas.lift``, as a client of its own."""

    def restart(self, service: str) -> None:
        """Kill that service's process, and wait until the supervisor has started it again and it is up."""


class Broken(Exception):
    """A scenario did not come to what is judged; the text says at which step, and why."""


class Runner:
    """Runs scenarios one after another in ``cell``; each begins with a new run of the world."""

    def __init__(self, cell: Cell, api: Api, note: Callable[[str], None] = lambda _: None) -> None:
        self._cell, self._api, self._note = cell, api, note
        cell.ask(Pause(paused=True))
        self._maps = Maps(api)
        self._now = 0.0
        self._contacts: tuple[str, ...] = ()

    def run(self, scenario: Scenario, seed: int | None = None, settings: Json | None = None) -> Verdict:
        """``seed``: instead of that of the scenario. ``settings``: of the chassis, beside those of the scenario."""
        begun = time.monotonic()
        chosen = scenario.seed if seed is None else seed
        self._played, self._undo = scenario, _Undo()
        self._move, self._posted = 0, 0.0
        problems: list[str] = []
        outcome = Outcome({"state": "not requested", "fail_reason": 0, "fail_message": ""}, {}, None)
        try:
            self._begin(chosen)
            self._set(settings or {})
            for number, step in enumerate(scenario.timeline, 1):
                self._take(step, f"step {number}")
            outcome = self._outcome()
            problems += judge(scenario.expect, outcome)
        except FAILURES as error:
            problems.append(_text(error))
        simulated = self._now
        try:
            problems += self._recover()
        except FAILURES as error:
            problems.append(f"after the scenario: {_text(error)}")
        move = outcome.move
        return Verdict(
            scenario=scenario.name,
            world=scenario.world,
            seed=chosen,
            state=move["state"],
            fail_reason=move["fail_reason"],
            fail_message=move["fail_message"],
            took=outcome.took,
            contacts=len(outcome.contacts),
            simulated=max(simulated, self._now),
            wall=time.monotonic() - begun,
            problems=tuple(problems),
        )

    # -- begin and end -----------------------------------------------------------------------------------------------

    def _begin(self, seed: int) -> None:
        before = self._cell.ask(Inspect()).clock.run
        self._cell.ask(Reset(seed=seed))
        self._wait_for_planner(lambda world: world.clock.run != before)
        self._advance(STEP)
        if self._played.start is not None:
            self._world(MoveRobot(robot=self._played.robot, pose=_pose(self._played.start)))
        self._advance(SETTLE)

    def _wait_for_planner(self, also: Callable[[WorldReply], bool] = lambda _: True) -> None:
        """Until it takes part in the run and has answered its state once."""
        robot, deadline = self._played.robot, time.monotonic() + JOINING
        while True:
            world = self._cell.ask(Inspect())
            if also(world) and f"{robot}/planner" in world.participants and robot in world.command_stamps:
                return
            if time.monotonic() > deadline:
                raise Broken(f"the planner of {robot} did not join the run within {JOINING:g} s; {world.participants}")
            time.sleep(0.02)

    def _recover(self) -> list[str]:
        """Undo what the scenario changed; then its ``then`` must succeed."""
        undo = self._undo
        for fault in undo.faults:
            self._world(self._fault(fault, active=False))
        self._wait_for_planner()  # which has lost a driver that was gone
        for name in undo.placed:
            self._world(Remove(name=name))
        if undo.map:
            self._maps.restore()
        if undo.settings:
            self._api.ask("POST", "/system/settings/user", {})
        self._advance(SETTLE)
        for number, step in enumerate(self._played.mend, 1):
            self._take(step, f"mend {number}")
        if self._played.then is None:
            return []
        self._note("the next job")
        self._post(self._played.then)
        move = self._finish(RECOVERY)
        self._put_rack_down()
        if move["state"] == "succeeded":
            return []
        told = f"{move['state']} with {move['fail_reason']} ({move['fail_message']})"
        return [f"the next job, {self._played.then}, {told}; expected that it succeeds"]

    # -- steps -------------------------------------------------------------------------------------------------------

    def _take(self, step: Step, name: str) -> None:
        self._note(name)
        if step.when is not None:
            self._wait(step.when, name)
        self._change_world(step)
        if step.kill is not None:
            self._cell.restart(step.kill)
            self._wait_for_planner()
        self._change_map(step)
        self._set(step.settings)
        if step.jack is not None:
            self._jack(step.jack)
        for lift, fields in step.lift.items():
            self._cell.ask_lift(lift, fields)
        if step.call is not None:
            self._api.ask(step.call.method, step.call.path, step.call.body, step.call.status)
        if step.move is not None:
            self._post(step.move)

    def _change_world(self, step: Step) -> None:
        for name, pose in step.put.items():
            robot = name == self._played.robot
            at = _pose(pose)
            self._world(MoveRobot(robot=name, pose=at) if robot else MoveObject(name=name, pose=at))
        for name, obstacle in step.place.items():
            self._world(_placed(name, obstacle))
            self._undo.placed.append(name)
        for name in step.remove:
            self._world(Remove(name=name))
            if name in self._undo.placed:
                self._undo.placed.remove(name)
        for name in step.restore:
            self._world(Restore(name=name))
        if step.push is not None:
            self._world(Push(name=step.push.name, shift=_pose(step.push.shift)))
        for fault in step.faults:
            self._world(self._fault(fault, active=True))
            self._undo.faults.append(fault)
        for fault in step.clear:
            self._world(self._fault(fault, active=False))

    def _change_map(self, step: Step) -> None:
        if step.map is None:
            return
        self._undo.map = step.map != "world"
        if step.map == "none":
            self._cell.use_no_map(self._played.robot)
        elif step.map == "world":
            self._maps.restore()
        else:
            self._maps.use(step.map)

    def _set(self, settings: Json) -> None:
        if settings:
            self._undo.settings = True
            self._api.ask("PATCH", "/system/settings/user", settings)

    def _jack(self, direction: str) -> None:
        self._api.ask("POST", f"/services/jack_{direction}", {})
        end = 1.0 if direction == "up" else 0.0

        def arrived() -> bool:
            jack = self._api.ask("GET", "/chassis/jack")
            return bool(jack["state"] == "hold" and abs(jack["progress"] - end) < 0.01)

        self._advance(STEP)
        self._until(arrived, f"the jack is {direction}", JACK_STROKE)
        self._advance(SETTLE)

    def _put_rack_down(self) -> None:
        """What the robot carries is kept on disk: the next run of the world must not begin with it."""
        status, content = self._api.send("GET", "/chassis/jack")
        if status == 200 and json.loads(content)["load"] == "carrying":
            self._jack("down")

    def _post(self, body: Json) -> None:
        self._move = self._api.post_move(body)
        self._posted, self._left = self._now, self._cell.true_pose(self._played.robot)

    def _wait(self, when: Condition, name: str) -> None:
        if when.after:
            self._advance(when.after)
        if when.driven is not None or when.near is not None or when.ended or when.planning_state:
            self._until(lambda: self._holds(when), f"{name}: {when.model_dump(exclude_defaults=True)}", when.within)

    def _holds(self, when: Condition) -> bool:
        if when.driven is not None or when.near is not None:
            pose = self._cell.true_pose(self._played.robot)
            if when.driven is not None and math.hypot(pose.x - self._left.x, pose.y - self._left.y) < when.driven:
                return False
            if when.near is not None and math.hypot(pose.x - when.near[0], pose.y - when.near[1]) > when.near[2]:
                return False
        if when.ended and self._api.move(self._move)["state"] not in TERMINAL:
            return False
        if when.planning_state:
            frame = self._api.newest_state()
            return all(frame.get(key) == value for key, value in when.planning_state.items())
        return True

    # -- the judged move ---------------------------------------------------------------------------------------------

    def _outcome(self) -> Outcome:
        move = self._finish(self._played.expect.within + GRACE)
        took = self._now - self._posted if move["state"] in TERMINAL else None
        frame = self._api.newest_state() if took is None else self._api.final_state(self._move, move["state"])
        asked = self._played.expect.explain is not None and took is not None
        explained = self._api.ask("GET", f"/chassis/moves/{self._move}/explain") if asked else {}
        return Outcome(move, frame, took, self._contacts, explained)

    def _finish(self, within: float) -> Json:
        """The newest move when it has ended, or as it is after so many seconds."""
        while True:
            move = self._api.move(self._move)
            if move["state"] in TERMINAL or self._now - self._posted > within:
                return move
            self._advance(STEP)

    # -- the world ---------------------------------------------------------------------------------------------------

    def _fault(self, fault: Fault, active: bool) -> InjectFault:
        return InjectFault(
            target=fault.target or self._played.robot,
            fault=fault.fault,
            part=fault.part,
            amount=fault.amount if active else None,
            pose=None if fault.pose is None or not active else _pose(fault.pose),
            active=active,
        )

    def _world(self, request: Message) -> None:
        self._read(self._cell.ask(request))

    def _advance(self, seconds: float) -> None:
        self._read(self._cell.ask(Advance(duration_ns=round(seconds * NANOSECONDS)), timeout=240.0))

    def _until(self, holds: Callable[[], bool], what: str, within: float) -> None:
        end = self._now + within
        while not holds():
            if self._now >= end:
                raise Broken(f"{within:g} s of simulation time passed before this: {what}")
            self._advance(STEP)

    def _read(self, reply: WorldReply) -> None:
        self._now = reply.clock.stamp / NANOSECONDS
        self._contacts = tuple(contact.other for contact in reply.contacts)


FAILURES = (Broken, ApiError, BusError)
"""What ends a scenario without a verdict on its move, and is a problem of that scenario alone."""


class _Undo:
    """What a scenario changed that must be undone."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []
        self.placed: list[str] = []
        self.map = self.settings = False


def _pose(pose: PoseTuple) -> Pose2:
    return Pose2(x=pose[0], y=pose[1], yaw=pose[2])


def _placed(name: str, obstacle: Obstacle) -> Place:
    return Place(
        name=name,
        kind=obstacle.kind,
        pose=_pose(obstacle.at),
        size=obstacle.size,
        walk=tuple(_pose(pose) for pose in obstacle.walk),
        speed=obstacle.speed,
    )


def _text(error: Exception) -> str:
    return error.text if isinstance(error, Refused) else str(error)
