"""What an arm hits: it stops, says what held it, and does not move when that goes. Both arms in physics."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.contact import hit, seeded_spots
from rackhand.schemas.base import Pose2
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.crf_contact import Contact
from rackhand.schemas.motion import ArmState
from rackhand.schemas.world import Place, Remove
from rackhand.services.controller import ik
from tests.joined.arm import JoinedArm
from tests.joined.checks import Array

Either = tuple[JoinedArm, ik.Arm]
SIDE = 0.12  # m, of the crate
AWAY = -0.9  # rad that joint 0 is asked to turn


def on_the_map(station: JoinedArm, q: Array) -> tuple[float, float]:
    """Where the tool is above the floor at joint positions ``q`` (n,)."""
    place = station.world.simulation.world.arms[station.name]
    x, y, yaw = place.pose
    tool = ik.forward(station.arm, q)[:, 3]
    c, s = math.cos(yaw), math.sin(yaw)
    return x + c * tool[0] - s * tool[1], y + s * tool[0] + c * tool[1]


def turned(arm: ik.Arm, angle: float) -> Array:
    return arm.home + np.append(angle, np.zeros(arm.n - 1))


def put_crate(station: JoinedArm, angle: float) -> None:
    """A tall crate that the tool touches when joint 0 has turned by about ``angle``."""
    x, y = on_the_map(station, turned(station.arm, angle))
    station.world.ask(Place(name="crate", kind="box", pose=Pose2(x=x, y=y, yaw=0.0), size=(SIDE, SIDE, 1.6)))


def peak_force(station: JoinedArm) -> float:
    return max((contact.force for contact in station.world.inspect().contacts), default=0.0)


def contacts(station: JoinedArm) -> list[Contact]:
    return [event.info for event in station.events if event.name == "contact" and isinstance(event.info, Contact)]


def still(states: list[ArmState], bound: float = 2e-3) -> None:
    q = np.array([state.q for state in states])
    assert np.ptp(q, axis=0).max() < bound, f"it moved by {np.ptp(q, axis=0).max():.4f} rad"


@pytest.mark.parametrize(("angle", "share"), [(-0.5, 0.1), (-0.55, 0.3), (-0.6, 0.5)])
def test_a_crate_in_the_way_stops_the_arm_and_nothing_moves_when_it_goes(
    either: Either, angle: float, share: float
) -> None:
    station, arm = either
    station.ok(command="setProfileVelocity", type="joints", data=(share * arm.limits.velocity).tolist())
    put_crate(station, angle)
    station.advance(0.2)
    station.ok(command="appendPath", type="joints", data=[turned(arm, AWAY).tolist()])
    states = station.advance(3.0)
    status = station.status()
    (contact,) = contacts(station)
    print(f"{arm.name} at {share} of its speed: {contact.kind} {contact.value:.3g} {contact.unit}, "
          f"hit with {peak_force(station):.0f} N")  # fmt: skip
    assert contact.stopped and contact.value > contact.bound
    assert status["isTrajectoryRunning"]["value"] is False
    assert CrfCode.EndEffectorToleranceViolation in status["controllerStatus"]
    assert status["contact"]["kind"] == contact.kind and status["contact"]["stopped"] is True
    assert states[-1].q[0] - arm.home[0] > AWAY + 0.15, "the crate is in the way"
    held = np.array(states[-1].efforts) - np.array(station.states[1].efforts)
    assert abs(held[0]) < 0.1 * arm.limits.torque[0], f"it presses with {held[0]:.1f} N·m"
    station.world.ask(Remove(name="crate"))
    still(station.advance(1.5), bound=5e-3)
    station.ok(command="appendPath", type="joints", data=[turned(arm, AWAY).tolist()])
    assert station.status().get("contact") is None, "of the last motion"
    assert abs(station.advance(8.0)[-1].q[0] - arm.home[0] - AWAY) < 1e-3, "a new command drives on"
    assert len(contacts(station)) == 1


def test_an_arm_that_slides_along_a_crate_comes_to_rest(either: Either) -> None:
    """At full speed the tool is driven off sideways, and what stops it must not lead it on."""
    station, arm = either
    met = hit(station, arm.name, 1.0, seeded_spots()[4])
    assert met.stopped and met.time < 0.8 and met.goes_on, met
    assert met.moved < 5e-3, met


def test_without_the_stop_condition_it_presses_with_a_bounded_torque(either: Either) -> None:
    station, arm = either
    station.ok(command="setParameters", data={"Controller": {"StopConditions": {"StopOnToleranceViolation": False}}})
    station.ok(command="setProfileVelocity", type="joints", data=(0.2 * arm.limits.velocity).tolist())
    put_crate(station, -0.6)
    station.advance(0.2)
    station.ok(command="appendPath", type="joints", data=[turned(arm, AWAY).tolist()])
    states = station.advance(4.0)
    last = np.array([state.efforts[0] for state in states[-250:]])
    pressed = abs(last.mean() - station.states[1].efforts[0]) / arm.limits.torque[0]
    assert 0.2 < pressed < 0.4, f"{pressed:.2f} of the torque limit"
    assert not contacts(station)[0].stopped
    assert CrfCode.EndEffectorToleranceViolation in station.status()["controllerStatus"]
    station.ask("a", True, command="softStop", priority=10)
    station.advance(1.0)
    station.world.ask(Remove(name="crate"))
    still(station.advance(1.5), bound=5e-3)


@pytest.mark.parametrize("kind", ["joints", "task"])
def test_a_velocity_into_a_crate_is_stopped_until_the_stream_has_paused(either: Either, kind: str) -> None:
    station, arm = either
    put_crate(station, -0.6)
    station.advance(0.2)
    codes = []
    for _ in range(60):
        jacobian = station.core.motion.kinematics.jacobian(station.core.motion.q)
        joints = np.append(-0.3, np.zeros(arm.n - 1))
        values = joints if kind == "joints" else jacobian @ joints
        more = {} if kind == "joints" else {"reference": 1}
        answer = station.ask("a", command="setVelocity", priority=10, type=kind, data=values.tolist(), **more)
        codes.append(answer["message"]["code"])
        station.advance(0.04)
    assert codes[0] == CrfCode.OK and codes[-1] == CrfCode.EndEffectorToleranceViolation
    assert len(contacts(station)) == 1 and contacts(station)[0].stopped
    states = station.advance(0.5)
    assert abs(states[-1].efforts[0] - station.states[1].efforts[0]) < 0.1 * arm.limits.torque[0]
    back = [0.3] + [0.0] * (arm.n - 1)
    for _ in range(10):
        station.ok(command="setVelocity", type="joints", data=back)
        station.advance(0.04)
    assert station.states[-1].q[0] > states[-1].q[0] + 0.05, "away from it again"


def test_free_motion_is_no_contact(either: Either) -> None:
    """At the limits of the arm, with stops of both kinds, and velocities in turn."""
    station, arm = either
    station.ok(command="setProfileVelocity", type="joints", data=arm.limits.velocity.tolist())
    station.ok(command="setProfileAcceleration", type="joints", data=arm.limits.acceleration.tolist())
    rng = np.random.default_rng(4)
    for stop in ("softStop", "hardStop"):
        points = [(arm.home + rng.uniform(-0.4, 0.4, arm.n)).tolist() for _ in range(4)]
        station.ok(command="appendPath", type="joints", data=points)
        station.advance(0.5)
        station.ask("a", True, command=stop, priority=10)
        station.advance(0.6)
    for turn in range(12):
        station.ok(command="setVelocity", type="joints", data=[0.5 * (-1) ** (turn // 4)] * arm.n)
        station.advance(0.04)
    station.advance(0.5)
    assert contacts(station) == []
    assert CrfCode.EndEffectorToleranceViolation not in station.status()["controllerStatus"]
