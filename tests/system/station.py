"""An arm's client in a whole cell, in lockstep: requests over Zenoh, physics underneath, time only in ``advance``."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from rackhand.bus import Bus, CallTimeout, Sample, Unavailable
from rackhand.schemas import topics
from rackhand.schemas.motion import ArmCommand, ArmState, CrfCall
from rackhand.schemas.service import CELL, ServiceId
from rackhand.schemas.world import Reset
from rackhand.testing import Cell, Judge
from tests.joined.checks import OK, Array
from tests.system.cell import ROOT

CONTROLLER = "arm1/controller"
PERIOD_NS = 4_000_000  # of its commands, and so of the published states


class Station:
    """A paused pick station, a judge, and a client of its arm. Time passes in ``advance`` only."""

    def __init__(self, cell: Cell, judge: Judge) -> None:
        self.cell, self.judge = cell, judge
        self.bus = Bus(ServiceId("client", CELL), cell.bus_config())
        self.bus.__enter__()
        self._states = self.bus.inbox().subscribe(topics.ARM_STATE, "arm1", depth=100_000)
        self._commands = self.bus.inbox().subscribe(topics.ARM_COMMAND, "arm1", depth=100_000)
        self._status = self.bus.inbox().subscribe(topics.MOTION_STATUS, "arm1", depth=10_000)
        self._events = self.bus.inbox().subscribe(topics.MOTION_EVENT, "arm1")
        self.settle()
        profile = self.ask("a", command="getConfiguration")["message"]["ProfileParameters"]
        self._profile = {"joints": profile["JointVelocities"], "task": profile["TaskVelocity"]}

    def reset(self) -> Station:
        """The world begins anew, and with it the controller. The profile's velocities, which outlive that, are as they
        were at first; nobody holds the arm, nothing is latched."""
        self.judge.ask(Reset())
        self.forget()
        self.settle()
        for kind, data in self._profile.items():
            self.ok(command="setProfileVelocity", type=kind, data=data)
        self.ask("a", command="unlockControl", priority=10)
        status = self.status()
        assert status["priorityUnderControl"] == 0 and "stoppedBy" not in status
        return self

    def settle(self) -> None:
        """Wait for the controller, until it has seen the arm, and until this client hears both."""
        self.cell.wait_for(self._joined, "the controller has joined")
        self.cell.wait_for(self._receives, "states are received")
        self.cell.wait_for(self.status_or_none, "the controller answers")
        self.advance(0.04)

    def forget(self) -> None:
        """What was heard is of a world that has begun anew."""
        for heard in (self._states, self._status, self._events, self._commands):
            while heard.get(timeout=0.2) is not None:
                pass

    def _joined(self) -> bool | None:
        return CONTROLLER in self.judge.inspect().participants or None

    def _receives(self) -> bool | None:
        self.judge.advance(0.02)
        return self._states.get(timeout=1.0) is not None or None

    def close(self) -> None:
        self.bus.__exit__(None, None, None)

    def ask(self, session: str, stop: bool = False, /, **request: Any) -> dict[str, Any]:
        return self.send(session, json.dumps(request), stop)

    def send(self, session: str, text: str, stop: bool = False) -> dict[str, Any]:
        query = topics.MOTION_STOP if stop else topics.MOTION
        answer = self.bus.call(query, CrfCall(session=session, text=text), "arm1", timeout=60.0)
        read: dict[str, Any] = json.loads(answer.text)
        return read

    def ok(self, **request: Any) -> None:
        answer = self.ask("a", **{"priority": 10, **request})
        assert answer["message"] == OK, answer

    def status(self) -> dict[str, Any]:
        return dict(self.ask("watcher", command="getStatus")["message"])

    def status_or_none(self) -> dict[str, Any] | None:
        """The same; None while the controller cannot be asked."""
        with suppress(Unavailable, CallTimeout):
            return self.status()
        return None

    def advance(self, seconds: float) -> list[ArmState]:
        """Simulation time passes; every state that was measured in it."""
        end = self.judge.advance(seconds).clock.stamp
        return self.states_until(end)

    def states_until(self, stamp: int) -> list[ArmState]:
        """The states from the last call on until that stamp. One is published each period of the controller."""
        last = stamp - stamp % PERIOD_NS
        found: list[ArmState] = []
        while not found or found[-1].stamp < last:
            event = self._states.get(timeout=20)
            assert isinstance(event, Sample), f"no state of {stamp}"
            if not found or event.message.stamp > found[-1].stamp:  # a state may be published again
                found.append(event.message)
        return found

    def commands(self) -> list[ArmCommand]:
        """Every command since the last call; those of the last instants may still be on their way."""
        found: dict[int, ArmCommand] = {}
        while (event := self._commands.get(timeout=0.2)) is not None:
            assert isinstance(event, Sample)
            found[event.message.answers] = event.message  # an instant may be answered again
        return [found[stamp] for stamp in sorted(found)]

    def drive_to(self, q: Array) -> None:
        """To joint positions, and forget the way."""
        self.ok(command="appendPath", type="joints", data=[q.tolist()])
        while self.status()["isTrajectoryRunning"]["value"]:
            self.advance(0.5)
        self.advance(0.5)
        self.commands()

    def events(self) -> list[str]:
        names = []
        while (event := self._events.get(timeout=0.2)) is not None:
            assert isinstance(event, Sample)
            names.append(event.message.name)
        return names


@contextmanager
def pick_station(
    folder: Path,
    kind: str = "ur5e",
    lockstep: bool = True,
    environment: dict[str, str] | None = None,
) -> Iterator[Station]:
    """The pick station with one arm or the other, paused."""
    world = folder / "world"
    shutil.copytree(ROOT / "worlds" / "pick_station", world)
    text = (world / "world.yaml").read_text()
    (world / "world.yaml").write_text(text.replace("kind: ur5e", f"kind: {kind}"))
    with (
        Cell(folder / "cell", world=world, lockstep=lockstep, environment=environment) as cell,
        Judge(cell.bus) as judge,
    ):
        judge.pause()
        station = Station(cell, judge)
        try:
            yield station
        finally:
            station.close()
