"""Stops, and references that fall silent, of both arms in physics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import ArmState, FencingToken
from rackhand.services.controller import ik
from tests.joined.arm import JoinedArm
from tests.joined.checks import OK, Array, check_commands, check_limits, first_rest, off_line, pose, speeds, tools

Either = tuple[JoinedArm, ik.Arm]
LATENCY = 4.0  # ms, from a measurement until the command that answers it takes effect


def corner_path(arm: ik.Arm, kind: str) -> tuple[dict[str, Any], Array]:
    """A path around one corner, fast, and the corner as a point of the tool."""
    start = ik.forward(arm, arm.home)
    corner, end = start.copy(), start.copy()
    corner[:, 3] += (0.0, 0.25, 0.0)
    end[:, 3] += (0.0, 0.25, -0.25)
    if kind == "task":
        return {"type": "task", "data": [pose(corner), pose(end)], "method": 2, "reference": 1}, corner[:, 3]
    first, second = arm.home.copy(), arm.home.copy()
    first[0] += 0.8
    second[:2] += (0.8, 0.4)
    return {"type": "joints", "data": [first.tolist(), second.tolist()]}, ik.forward(arm, first)[:, 3]


@pytest.mark.parametrize("kind", ["joints", "task"])
def test_a_soft_stop_stays_on_the_path(either: Either, kind: str) -> None:
    """From full speed on a straight, inside the blend of a corner, and while it still gets faster."""
    station, arm = either
    station.ok(command="setProfileVelocity", type="task", data=[0.6] * 3 + [2.0] * 3)
    path, corner = corner_path(arm, kind)
    station.advance(0.1)
    station.ok(command="appendPath", **path)
    whole = tools(station.advance(6.0), arm)[:, :, 3]
    moving = np.linalg.norm(np.diff(whole, axis=0), axis=1) / 0.002
    near = int(np.linalg.norm(whole - corner, axis=1).argmin())
    outline = whole[np.append(True, moving > 1e-6)]
    for name, moment in (("getting faster", near // 3), ("at full speed", near * 2 // 3), ("in the corner", near - 30)):
        station.drive_to(arm.home)
        station.ok(command="appendPath", **path)
        states = station.advance(0.002 * (moment // 2 * 2))
        fast = speeds(states)[-1]
        assert station.ask("a", True, command="softStop", priority=10)["message"] == OK
        braking = station.advance(1.0)
        points = tools(states[-1:] + braking, arm)[:, :, 3]
        off = max(off_line(outline, point) for point in points)
        print(f"{arm.name} {kind} {name}: from {fast:.2f} rad/s, off the path by {off * 1e3:.3f} mm,")
        print(
            f"  at rest after {first_rest(braking, states[-1].stamp):.0f} ms and {np.ptp(points, axis=0).max():.3f} m"
        )
        assert fast > 0.1 and off <= 1e-3
        assert speeds(braking)[-1] < 1e-3
        assert np.linalg.norm(points[-1] - outline[-1]) > 0.02, "it stopped on the way"
        check_limits(states + braking, arm)
        check_commands(station.commands(), arm)


def test_a_hard_stop_is_faster_and_nothing_moves_by_itself_afterwards(either: Either) -> None:
    """Two seconds later either; who has less priority is refused, the holder only goes on when it has resumed."""
    station, arm = either
    goal = arm.home + np.append(1.5, np.zeros(arm.n - 1))
    taken = {}
    for stop in ("softStop", "hardStop"):
        station.drive_to(arm.home)
        station.ok(command="appendPath", type="joints", data=[goal.tolist(), arm.home.tolist()])
        states = station.advance(0.6)
        assert speeds(states)[-1] > 0.45 * arm.limits.velocity[0]
        assert station.ask("b", True, command=stop)["message"] == OK
        braking = station.advance(1.0)
        taken[stop] = first_rest(braking, states[-1].stamp)
        # At the FR3's jerk a hard stop's deceleration is there within half a control period: the servo overshoots it.
        check_limits(states + braking, arm, overshoot=1.3)
        check_commands(station.commands(), arm)
        where = np.array(braking[-1].q)
        if stop == "softStop":
            station.ok(command="resumeControl")
    print(f"{arm.name}: at rest {taken} ms after the stop")
    assert taken["hardStop"] < 0.8 * taken["softStop"]
    assert np.abs(where - arm.home).max() > 0.1 and np.abs(where - goal).max() > 0.1
    still(station.advance(2.0), where)
    assert station.status()["isTrajectoryRunning"]["value"] is False
    velocity = {"command": "setVelocity", "type": "joints", "data": [0.2] * arm.n}
    for session, priority in (("c", 20), ("a", 10)):
        for request in ({"command": "appendPath", "type": "joints", "data": [arm.home.tolist()]}, velocity):
            refused = station.ask(session, priority=priority, **request)
            assert refused["message"]["code"] == CrfCode.Forbidden and refused["text"], (session, refused)
    still(station.advance(0.5), where)
    station.ok(command="resumeControl")
    still(station.advance(0.5), where)
    station.ok(command="appendPath", type="joints", data=[arm.home.tolist()])
    assert np.abs(np.array(station.advance(4.0)[-1].q) - arm.home).max() < 1e-4


def still(states: list[ArmState], where: Array) -> None:
    moved = np.abs(np.array([state.q for state in states]) - where).max()
    assert moved < 1e-4, f"it moved by {moved} rad"


# -- references that fall silent --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["joints", "task"])
def test_a_velocity_that_falls_silent_is_zero_100_ms_later(either: Either, kind: str) -> None:
    station, arm = either
    values = [0.3] + [0.0] * (arm.n - 1) if kind == "joints" else [0.0, 0.1, 0.0, 0.0, 0.0, 0.0]
    more = {} if kind == "joints" else {"reference": 1}
    for _ in range(12):
        station.ok(command="setVelocity", type=kind, data=values, **more)
        last = station.advance(0.04)[0].stamp - 2_000_000
    station.commands()
    states = station.advance(0.5)
    speed = speeds(states)
    full = speed[0]
    moving = [s.stamp for s, v in zip(states, speed, strict=True) if v > 0.97 * full]
    print(f"{arm.name} {kind}: full for {(moving[-1] - last) / 1e6:.0f} ms, at rest {first_rest(states, last):.0f} ms")
    assert 96 <= (moving[-1] - last) / 1e6 - LATENCY <= 112
    assert first_rest(states, last) < 300
    rates = np.abs(np.diff([c.values for c in station.commands()], axis=0)).max(axis=1) / 0.004
    falling = rates[int(np.argmax(rates < 0.99 * full)) :]
    # The ramp is monotonic to rounding: a rate is the difference of two positions of a radian, over 4 ms.
    assert (np.diff(falling) < 1e-12).all(), np.diff(falling).max()


@pytest.mark.parametrize("kind", ["joints", "base", "tool"])
def test_torques_come_on_top_of_gravity_and_end_100_ms_after_the_last(either: Either, kind: str) -> None:
    """None: the arm floats. A little of one: it moves that way. Silence: a soft stop."""
    station, arm = either
    start = ik.forward(arm, arm.home)
    rotation = start[:, :3] if kind == "tool" else np.eye(3)
    push = rotation.T @ np.array([0.0, 8.0, 0.0])  # along y of the base
    none, some = [0.0] * 6, [*push.tolist(), 0.0, 0.0, 0.0]
    more: dict[str, Any] = {"type": "task", "reference": 2 if kind == "tool" else 1}
    if kind == "joints":
        none, some = [0.0] * arm.n, [8.0] + [0.0] * (arm.n - 1)
        more = {"type": "joints"}
    states = []
    for _ in range(10):
        station.ok(command="setTorque", data=none, **more)
        states += station.advance(0.04)
    assert np.abs(np.array(states[-1].q) - arm.home).max() < 1e-3, "it floats"
    for _ in range(5):
        station.ok(command="setTorque", data=some, **more)
        states = station.advance(0.04)
    last = states[0].stamp - 2_000_000
    moved = ik.forward(arm, np.array(states[-1].q))[:, 3] - start[:, 3]
    states += station.advance(0.8)
    speed = speeds(states)
    efforts = np.abs([s.efforts for s in states]).max(axis=0)
    fastest = max(zip(speed, states, strict=True), key=lambda pair: pair[0])[1].stamp
    print(f"{arm.name} {kind}: moved {moved.round(4).tolist()}, driven for {(fastest - last) / 1e6:.0f} ms")
    if kind == "joints":
        assert states[-1].q[0] - arm.home[0] > 1e-3
    else:
        assert moved[1] > 1e-3 and np.abs(moved[[0, 2]]).max() < 0.5 * moved[1]
    assert (efforts <= arm.limits.torque).all()
    assert (fastest - last) / 1e6 - LATENCY <= 112
    assert first_rest(states, last) < 500
    still(station.advance(0.5), np.array(states[-1].q))


def test_torques_are_bounded(either: Either) -> None:
    """Of the joints the protocol refuses what they cannot; a wrench is scaled to what they can."""
    station, arm = either
    too_much = (1.1 * arm.limits.torque).tolist()
    refused = station.ask("a", command="setTorque", priority=10, type="joints", data=too_much)
    assert refused["message"]["code"] == CrfCode.BadRequest and "at most" in refused["text"]
    station.ok(command="setTorque", type="task", data=[0.0, 1e5, 0.0, 0.0, 0.0, 0.0], reference=1)
    station.commands()
    states = station.advance(0.02)
    asked = np.abs([c.values for c in station.commands() if c.mode == "torque"])
    assert asked.size and (asked <= arm.limits.torque * (1 + 1e-9)).all()
    assert (np.abs([s.efforts for s in states]) <= arm.limits.torque).all()
    assert speeds(station.advance(1.0))[-1] < 1e-3


# -- torques that end -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("torque", "seconds"), [(5.0, 0.28), (2.0, 0.4)])
def test_a_torque_that_ends_while_the_arm_moves_brakes_within_the_limits(
    either: Either, torque: float, seconds: float
) -> None:
    station, arm = either
    torque *= arm.limits.torque[-1] / 28.0
    for _ in range(round(seconds / 0.04)):
        station.ok(command="setTorque", type="joints", data=[0.0] * (arm.n - 1) + [torque])
        station.advance(0.04)
    states = station.advance(1.5)
    speed = np.array([state.dq[-1] for state in states])
    fastest = int(np.abs(speed).argmax())
    braking = (speed[fastest + 2 :] - speed[fastest:-2]) / 0.004 / arm.limits.acceleration[-1]
    print(f"{arm.name}: at {np.abs(speed).max():.2f} rad/s, braked with {np.abs(braking).max():.2f} of its limit")
    assert np.abs(speed).max() > 0.5
    # Where the first positions take effect there is a step of the reference's velocity, within one control period.
    assert np.abs(braking).max() < 1.7
    assert np.sort(np.abs(braking))[-4] < 1.25, "for at most two control periods"
    assert np.abs(speed[-1]) < 1e-3


def test_a_torque_into_the_end_of_a_range_commands_nothing_outside(either: Either) -> None:
    station, arm = either
    joint = 3 if arm.n == 6 else 6
    start = arm.home.copy()
    start[joint] = arm.limits.upper[joint] - 0.15
    station.drive_to(start)
    push = np.zeros(arm.n)
    push[joint] = 0.6 * arm.limits.torque[joint]
    for _ in range(20):
        station.ask("a", command="setTorque", priority=10, type="joints", data=push.tolist())
        station.advance(0.04)
    sent = [command.values[joint] for command in station.commands() if command.mode == "position"]
    assert sent and max(sent) <= arm.limits.upper[joint]
    most = max(state.q[joint] for state in station.states)
    print(f"{arm.name}: {1e3 * (arm.limits.upper[joint] - most):.1f} mrad before the end of the range")
    assert most <= arm.limits.upper[joint] + 0.01


def test_a_stray_command_is_noticed_and_the_arm_obeys_again(either: Either) -> None:
    station, arm = either
    goal = arm.home + np.append(0.5, np.zeros(arm.n - 1))
    newest = station.sent[-1]
    stray = newest.model_copy(update={"token": FencingToken(epoch="another", lease=1)})
    station.world.session.command(station.name, stray)
    station.advance(0.04)
    station.advance(0.04)
    assert CrfCode.Disconnected in station.status()["controllerStatus"]
    station.advance(0.2)
    station.ok(command="appendPath", type="joints", data=[goal.tolist()])
    assert np.abs(np.array(station.advance(4.0)[-1].q) - goal).max() < 1e-3
