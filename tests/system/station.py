"""An arm's client in a whole cell, in lockstep: requests over Zenoh, physics underneath, time only in ``advance``."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rackhand.bus import Bus, CallTimeout, Sample, Unavailable
from rackhand.schemas import topics
from rackhand.schemas.motion import ArmCommand, ArmState, CrfCall
from rackhand.schemas.service import CELL, ServiceId
from rackhand.schemas.world import Reset
from rackhand.services.controller import ik
from tests.system.cell import ROOT, Cell
from tests.system.judge import Judge

Array = NDArray[np.float64]

ARM = ik.load_arm("ur5e")
OK = {"value": True, "code": 200, "detail": 0}
BAD = {"code": 400, "detail": 0}
CONTROLLER = "arm1/controller"
PERIOD = 0.004  # seconds between commands
LOCKSTEP = ("--lockstep", "--speed", "max")


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
        self.cell.wait_for(self._hears, "states are heard")
        self.cell.wait_for(self.status_or_none, "the controller answers")
        self.advance(0.04)

    def forget(self) -> None:
        """What was heard is of a world that has begun anew."""
        for heard in (self._states, self._status, self._events, self._commands):
            while heard.get(timeout=0.2) is not None:
                pass

    def _joined(self) -> bool | None:
        return CONTROLLER in self.judge.inspect().participants or None

    def _hears(self) -> bool | None:
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
        found: list[ArmState] = []
        while not found or found[-1].stamp < stamp:
            event = self._states.get(timeout=20)
            assert isinstance(event, Sample), f"no state of {stamp}"
            if not found or event.message.stamp > found[-1].stamp:  # an instant may be told again
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
    options: tuple[str, ...] = LOCKSTEP,
    environment: dict[str, str] | None = None,
) -> Iterator[Station]:
    """The pick station with one arm or the other, paused."""
    world = folder / "world"
    shutil.copytree(ROOT / "worlds" / "pick_station", world)
    text = (world / "world.yaml").read_text()
    (world / "world.yaml").write_text(text.replace("kind: ur5e", f"kind: {kind}"))
    given = ("--world", str(world), "--crf-port", "0", *options)
    with Cell(folder / "cell", *given, environment=environment) as cell, Judge(cell.bus) as judge:
        judge.pause()
        station = Station(cell, judge)
        try:
            yield station
        finally:
            station.close()


def tools(states: list[ArmState], arm: ik.Arm = ARM) -> Array:
    """Poses (m, 3, 4) of the tool."""
    return np.array([ik.forward(arm, np.array(state.q)) for state in states])


def speeds(states: list[ArmState]) -> Array:
    """Fastest joint of each state, rad/s."""
    return np.array([max(map(abs, state.dq)) for state in states])


def pose(matrix: Array) -> dict[str, Any]:
    rows = {f"Row{i + 1}": matrix[i, :3].tolist() for i in range(3)}
    return {"Position": matrix[:, 3].tolist(), "Orientation": {"Matrix": rows}}


def off_line(line: Array, point: Array) -> float:
    """Distance (m) from a point to a polyline (m, 3) of short pieces."""
    nearest = int(np.linalg.norm(line - point, axis=1).argmin())
    pieces = [(a, b - a) for a, b in pairwise(line[max(nearest - 1, 0) : nearest + 2]) if (a != b).any()]
    return min(float(np.linalg.norm(np.cross(d, point - a)) / np.linalg.norm(d)) for a, d in pieces)


def blended(corners: list[Array], deviation: float = 0.01) -> Array:
    """The outline every 0.2 mm: straight legs, corners rounded by the documented quintic that passes them by
    ``deviation`` at most (x = a t₁ + b t₂, b = 2r(u³ − u⁴/2), 3r/16·|t₂ − t₁| = deviation)."""
    out: list[Array] = []
    legs = list(pairwise(corners))
    directions = [(b - a) / np.linalg.norm(b - a) for a, b in legs]
    radius = [0.0]
    for first, second, leg, after in zip(directions, directions[1:], legs, legs[1:], strict=False):
        bend = np.linalg.norm(second - first)
        longest = min(np.linalg.norm(leg[1] - leg[0]), np.linalg.norm(after[1] - after[0])) / 2
        radius.append(float(min(16 * deviation / (3 * bend), longest)) if bend > 1e-9 else 0.0)
    radius.append(0.0)
    for i, (a, b) in enumerate(legs):
        length = np.linalg.norm(b - a)
        out += [a + d * directions[i] for d in np.arange(radius[i], length - radius[i + 1], 2e-4)]
        r = radius[i + 1]
        if r > 0:
            for u in np.linspace(0, 1, int(2 * r / 2e-4)):
                second = 2 * r * (u**3 - u**4 / 2)
                first = (2 * u - 1) * r - second
                out.append(b + first * directions[i] + second * directions[i + 1])
    return np.array([*out, corners[-1]])


def check_commands(commands: list[ArmCommand], arm: ik.Arm, jerk: bool = True) -> None:
    """Position, velocity, acceleration and jerk limits of what is commanded, period by period."""
    assert {command.mode for command in commands} == {"position"}
    stamps = np.array([command.answers for command in commands])
    q = np.array([command.values for command in commands])
    limits = arm.limits
    assert (q >= limits.lower - 1e-9).all() and (q <= limits.upper + 1e-9).all()
    gaps = np.flatnonzero(np.diff(stamps) != round(PERIOD * 1e9)) + 1
    assert gaps.size < 0.02 * len(commands), "too much went past this client"
    for run in np.split(q, gaps):
        bounds = (1.001 * limits.velocity, 1.01 * limits.acceleration, 1.02 * limits.jerk)
        for n, bound in enumerate(bounds if jerk else bounds[:2], start=1):
            rates = np.abs(np.diff(run, n, axis=0)) / PERIOD**n
            assert (rates <= bound).all(), (n, rates.max(axis=0))


def check_limits(states: list[ArmState], arm: ik.Arm, overshoot: float = 1.05) -> None:
    """As measured: positions, velocities, and accelerations over one control period, these up to ``overshoot``."""
    q, dq = np.array([s.q for s in states]), np.array([s.dq for s in states])
    t = np.array([s.stamp for s in states]) * 1e-9
    limits = arm.limits
    assert (q >= limits.lower - 1e-4).all() and (q <= limits.upper + 1e-4).all()
    assert (np.abs(dq) <= 1.01 * limits.velocity).all(), np.abs(dq).max(axis=0)
    ddq = (dq[2:] - dq[:-2]) / (t[2:] - t[:-2])[:, None]
    assert (np.abs(ddq) <= overshoot * limits.acceleration).all(), np.abs(ddq).max(axis=0)


def first_rest(states: list[ArmState], since: int) -> float:
    """ms from ``since`` until no joint is faster than 1 mrad/s for good."""
    last = max(s.stamp for s, v in zip(states, speeds(states), strict=True) if v > 1e-3)
    return (last - since) / 1e6
