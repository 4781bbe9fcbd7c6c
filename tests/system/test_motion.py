"""The arm of the pick station through the whole cell: requests over Zenoh, physics underneath.

In lockstep and simulation time: what is measured does not depend on the machine.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bus import Bus, CallTimeout, Sample, Unavailable
from schemas import topics
from schemas.motion import ArmState, CrfCall
from schemas.service import CELL, ServiceId
from services.controller import ik
from tests.system.cell import ROOT, Cell
from tests.system.judge import Judge

Array = NDArray[np.float64]

ARM = ik.load_arm("ur5e")
OK = {"value": True, "code": 200, "detail": 0}
BAD = {"code": 400, "detail": 0}
CONTROLLER = "arm1/controller"


class Station:
    """A paused pick station, a judge, and a client of its arm. Time passes in ``advance`` only."""

    def __init__(self, cell: Cell, judge: Judge) -> None:
        self.cell, self.judge = cell, judge
        self.bus = Bus(ServiceId("client", CELL), cell.bus_config())
        self.bus.__enter__()
        self._states = self.bus.inbox().subscribe(topics.ARM_STATE, "arm1", depth=100_000)
        self._status = self.bus.inbox().subscribe(topics.MOTION_STATUS, "arm1", depth=10_000)
        self._events = self.bus.inbox().subscribe(topics.MOTION_EVENT, "arm1")
        self.settle()

    def settle(self) -> None:
        """Wait for the controller, and until it has seen the arm."""
        self.cell.wait_for(self._joined, "the controller has joined")
        self.advance(0.04)

    def forget(self) -> None:
        """What was heard is of a world that has begun anew."""
        for heard in (self._states, self._status, self._events):
            while heard.get(timeout=0.2) is not None:
                pass

    def _joined(self) -> bool | None:
        return CONTROLLER in self.judge.inspect().participants or None

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

    def events(self) -> list[str]:
        names = []
        while (event := self._events.get(timeout=0.2)) is not None:
            assert isinstance(event, Sample)
            names.append(event.message.name)
        return names


@pytest.fixture
def station(tmp_path: Path) -> Iterator[Station]:
    with Cell(tmp_path, "--world", "pick_station", "--lockstep", "--speed", "max") as cell, Judge(cell.bus) as judge:
        judge.pause()
        station = Station(cell, judge)
        yield station
        station.close()


@pytest.fixture(params=["ur5e", "fr3"])
def either(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[Station, ik.Arm]]:
    """The pick station with one arm or the other."""
    world = tmp_path / "world"
    shutil.copytree(ROOT / "worlds" / "pick_station", world)
    text = (world / "world.yaml").read_text()
    (world / "world.yaml").write_text(text.replace("kind: ur5e", f"kind: {request.param}"))
    options = ("--world", str(world), "--lockstep", "--speed", "max")
    with Cell(tmp_path / "cell", *options) as cell, Judge(cell.bus) as judge:
        judge.pause()
        station = Station(cell, judge)
        yield station, ik.load_arm(request.param)
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


def test_a_locked_arm_drives_a_joint_path(station: Station) -> None:
    assert station.ask("a", command="lockControl", priority=10, id=1)["message"] is True
    goal = ARM.home + 0.3
    station.ok(command="appendPath", type="joints", data=[(ARM.home + 0.1).tolist(), goal.tolist()])
    states = station.advance(3.0)
    assert np.abs(np.array(states[-1].q) - goal).max() < 1e-4
    assert speeds(states)[-1] < 1e-3
    assert station.status()["isTrajectoryRunning"]["value"] is False
    assert station.status()["priorityUnderControl"] == 10


def test_a_square_is_tracked(either: tuple[Station, ik.Arm]) -> None:
    """0.4 m sides at 0.25 m/s: what is driven is within 1 mm and 0.2° of the square with its corners blended."""
    station, arm = either
    start = ik.forward(arm, np.array(station.advance(0.02)[-1].q))
    station.ok(command="setProfileVelocity", type="task", data=[0.25] * 3 + [1.0] * 3)
    half = 0.2
    corners = []
    for y, z in ((half, 0.0), (half, -2 * half), (-half, -2 * half), (-half, 0.0), (0.0, 0.0)):
        corner = start.copy()
        corner[:, 3] += (0.0, y, z)
        corners.append(corner)
    station.ok(command="appendPath", type="task", data=[pose(c) for c in corners], method=2, reference=1)
    states = station.advance(9.0)
    driven = tools(states, arm)
    points = driven[:, :, 3]
    expected = blended([start[:, 3], *(c[:, 3] for c in corners)])
    off = np.array([off_line(expected, p) for p in points])
    turned = [np.degrees(np.arccos(np.clip((np.trace(start[:, :3].T @ d[:, :3]) - 1) / 2, -1, 1))) for d in driven]
    speed = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff([s.stamp * 1e-9 for s in states])
    print(f"off by {off.max() * 1e3:.3f} mm, turned by {max(turned):.4f} deg, fastest {speed.max():.3f} m/s")
    check_limits(states, arm)
    assert off.max() <= 1e-3
    assert max(turned) <= 0.2
    assert 0.24 < speed.max() < 0.26
    assert np.linalg.norm(points[-1] - start[:, 3]) < 1e-4
    assert np.ptp(points[:, 1]) > 0.399 and np.ptp(points[:, 2]) > 0.399


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


def test_a_path_through_a_wrist_singularity_slows_down_and_finishes(station: Station) -> None:
    """The tool moves sideways while wrist 2 passes 0, where joints 4 and 6 are parallel; then out to the edge of
    reach."""
    begin = ARM.home.copy()
    begin[4] = -0.3
    station.ok(command="appendPath", type="joints", data=[begin.tolist()])
    station.advance(4.0)
    through = begin.copy()
    through[4] = 0.3
    a, b = ik.forward(ARM, begin), ik.forward(ARM, through)
    station.ok(command="appendPath", type="task", data=[pose(b)], method=2, reference=1)
    states = station.advance(8.0)
    check_limits(states, ARM)
    q = np.array([s.q for s in states])
    assert np.abs(tools(states)[-1] - b).max() < 1e-4
    assert speeds(states)[-1] < 1e-3
    assert q[0, 4] * q[-1, 4] < 0 or 801 in station.status()["controllerStatus"]
    line = np.array([a[:, 3] + share * (b[:, 3] - a[:, 3]) for share in np.linspace(0, 1, 400)])
    off = max(off_line(line, p) for p in tools(states)[:, :, 3])
    print(f"off the line by {off * 1e3:.3f} mm, fastest joint {speeds(states).max():.2f} rad/s")
    assert off <= 1e-3


def check_limits(states: list[ArmState], arm: ik.Arm) -> None:
    """As measured: positions, velocities, and accelerations over one control period."""
    q, dq = np.array([s.q for s in states]), np.array([s.dq for s in states])
    t = np.array([s.stamp for s in states]) * 1e-9
    limits = arm.limits
    assert (q >= limits.lower - 1e-4).all() and (q <= limits.upper + 1e-4).all()
    assert (np.abs(dq) <= 1.01 * limits.velocity).all(), np.abs(dq).max(axis=0)
    ddq = (dq[2:] - dq[:-2]) / (t[2:] - t[:-2])[:, None]
    assert (np.abs(ddq) <= 1.05 * limits.acceleration).all(), np.abs(ddq).max(axis=0)


def test_a_velocity_that_falls_silent_ends(station: Station) -> None:
    for _ in range(10):
        station.ok(command="setVelocity", type="joints", data=[0.3] * 6)
        station.advance(0.04)
    cut = station.judge.inspect().clock.stamp - 40_000_000
    states = station.advance(0.5)
    speed = speeds(states)
    moving = [s.stamp for s, v in zip(states, speed, strict=True) if v > 0.29]
    print(
        f"full speed until {(moving[-1] - cut) / 1e6:.0f} ms, at rest {first_rest(states, cut):.0f} ms after the last"
    )
    assert (moving[-1] - cut) / 1e6 <= 112, "the reference is zero 100 ms after the last command"
    assert first_rest(states, cut) < 250
    # The last milliradians per second are the joint servo's settling.
    after = [max(v, 5e-3) for s, v in zip(states, speed, strict=True) if s.stamp > cut + 112_000_000]
    assert (np.diff(after) < 1e-4).all(), "decays monotonically"


def first_rest(states: list[ArmState], since: int) -> float:
    """ms from ``since`` until no joint is faster than 1 mrad/s for good."""
    last = max(s.stamp for s, v in zip(states, speeds(states), strict=True) if v > 1e-3)
    return (last - since) / 1e6


def test_a_soft_stop_at_full_speed_stays_on_the_line(station: Station) -> None:
    start = ik.forward(ARM, np.array(station.advance(0.02)[-1].q))
    end = start.copy()
    end[:, 3] += (0.0, 0.3, -0.2)
    station.ok(command="setProfileVelocity", type="task", data=[1.0] * 3 + [3.0] * 3)
    station.ok(command="appendPath", type="task", data=[pose(end)], method=2, reference=1)
    before = station.advance(0.3)
    assert station.ask("b", True, command="softStop")["message"] == OK
    states = station.advance(1.0)
    points = tools(before + states)[:, :, 3]
    along = (end[:, 3] - start[:, 3]) / np.linalg.norm(end[:, 3] - start[:, 3])
    away = points - start[:, 3]
    off = np.linalg.norm(away - (away @ along)[:, None] * along, axis=1)
    print(f"off the line by {off.max() * 1e3:.3f} mm, at most {speeds(before).max():.2f} rad/s")
    assert speeds(states)[-1] < 1e-3
    assert off.max() <= 1e-3
    assert np.linalg.norm(points[-1] - end[:, 3]) > 0.02, "it stopped on the way"
    refused = station.ask("a", command="appendPath", priority=10, type="joints", data=[ARM.home.tolist()])
    assert refused["message"]["code"] == 403
    assert np.array_equal(np.round(states[-1].q, 5), np.round(station.advance(0.5)[-1].q, 5)), "nothing moves by itself"


def test_a_killed_controller_leaves_the_joints_at_rest(station: Station) -> None:
    """It comes back with no holder and an empty queue."""
    station.ok(command="appendPath", type="joints", data=[(ARM.home + 1.0).tolist()])
    moving = station.advance(0.5)
    assert speeds(moving)[-1] > 0.5
    epoch = station.status()["epoch"]
    former = station.cell.kill(controller_row(station.cell))
    station.cell.wait_for(lambda: CONTROLLER not in station.judge.inspect().participants or None, "it is missed")
    states = station.advance(1.0)
    print(f"at rest {first_rest(states, moving[-1].stamp):.0f} ms after the last command")
    assert first_rest(states, moving[-1].stamp) < 600
    assert np.abs(np.array(states[-1].q) - ARM.home - 1.0).max() > 0.1, "far from where it was going"
    station.cell.wait_until_restarted(controller_row(station.cell), former)
    station.cell.wait_for(lambda: status_or_none(station), "it answers")
    station.settle()
    status = station.status()
    assert status["epoch"] != epoch
    assert status["priorityUnderControl"] == 0
    assert status["isTrajectoryRunning"]["value"] is False
    after = station.advance(0.5)
    assert np.abs(np.array(after[-1].q) - np.array(states[-1].q)).max() < 1e-4, "nothing goes on"
    station.ok(command="appendPath", type="joints", data=[ARM.home.tolist()])
    assert np.abs(np.array(station.advance(4.0)[-1].q) - ARM.home).max() < 1e-4


def controller_row(cell: Cell) -> str:
    """What the supervisor calls the arm's controller."""
    facts = json.loads((cell.state_dir / "cell.json").read_text())
    return next(str(name) for name in facts["pids"] if "controller" in name)


def status_or_none(station: Station) -> dict[str, Any] | None:
    with suppress(Unavailable, CallTimeout):
        return station.status()
    return None
