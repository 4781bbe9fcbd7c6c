"""Requests to a running simulation, its replies, and the commands of its participants."""

from __future__ import annotations

from itertools import count
from typing import Any

import pytest

from rackhand.schemas import world as asked
from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.motion import ArmCommand, FencingToken
from rackhand.schemas.refusal import RequestRefused
from rackhand.schemas.service import ServiceId
from rackhand.services.sim.pacing import Pacer
from rackhand.services.sim.session import Run, Session
from rackhand.services.sim.simulation import CONTROL_STEP_NS
from tests.sim.helpers import STILL, make_simulation, make_world

PERIOD = 2 * CONTROL_STEP_NS


def make_session(**pace: Any) -> Session:
    numbers = count(1)
    world = make_world()
    return Session(
        build=lambda seed: make_simulation(world, seed),
        new_run=lambda: Run(f"run{next(numbers)}", 1_000),
        seed=4,
        pacer=Pacer(CONTROL_STEP_NS, **({"speed": None} | pace)),
    )


def ask(session: Session, request: Any) -> asked.WorldReply:
    reply = session.handle(asked.WorldRequest(request=request))
    assert reply is not None
    return reply


def join(period: int = PERIOD, robot: str = "amr1", service: str = "planner", latency: int = 1) -> asked.Join:
    return asked.Join(robot=robot, service=service, period_ns=period, latency=latency)


def test_inspect_reports_the_state_of_the_simulation() -> None:
    session = make_session(lockstep=True)
    session.step()
    reply = ask(session, asked.Inspect())
    assert reply.clock == asked.Clock(
        stamp=CONTROL_STEP_NS,
        run="run1",
        step_ns=CONTROL_STEP_NS,
        speed=None,
        paused=False,
        lockstep=True,
        unix_ns=1_000,
    )
    assert (reply.seed, reply.contact_count, reply.participants) == (4, 0, ())
    assert reply.digest == session.simulation.digest


def test_join_and_leave() -> None:
    session = make_session()
    assert ask(session, join()).participants == ("amr1/planner",)
    assert session.take_changes().outputs, "a participant that joins receives the present step"
    assert not session.take_changes().outputs
    assert ask(session, asked.Leave(robot="amr1", service="planner")).participants == ()


@pytest.mark.parametrize(
    ("request_", "code", "told"),
    [
        (join(robot="amr9"), "not_found", "known: \\['amr1'\\]"),
        (join(service="viewer"), "not_found", "known: \\['planner'\\]"),
        (join(period=30_000_000), "invalid", "not a multiple of the control step"),
        (join(latency=2), "invalid", "command latency of 2 periods of 40000000 ns"),
        (asked.Advance(duration_ns=1), "precondition", "pause it"),
        (asked.Remove(name="nothing"), "not_found", "is not known"),
        (asked.MoveRobot(robot="x", pose=Pose2(x=0, y=0, yaw=0)), "not_found", "is not known"),
        (asked.InjectFault(target="x", fault="lidar_dead"), "not_found", "is not known"),
    ],
)
def test_an_invalid_request_is_refused(request_: Any, code: str, told: str) -> None:
    session = make_session()
    with pytest.raises(RequestRefused, match=told) as refused:
        session.handle(asked.WorldRequest(request=request_))
    assert refused.value.code == code


def test_an_arm_is_commanded_by_its_controller_at_its_own_steps() -> None:
    arms = {"arm1": {"kind": "ur5e", "pose": (0, 3, 0), "mount": 0.6}}
    world = make_world(arms=arms)
    session = Session(
        build=lambda seed: make_simulation(world, seed),
        new_run=lambda: Run("run", 0),
        seed=0,
        pacer=Pacer(world.control_step_ns, speed=None, lockstep=True),
    )
    controller, planner = join(4_000_000, "arm1", "controller", latency=0), join(latency=0)
    for wrong, told in (
        (join(4_000_000, "arm1"), "known: \\['controller'\\]"),
        (join(3_000_000, "arm1", "controller"), "not a multiple of the control step of 2000000 ns"),
        (join(22_000_000), "not a multiple of the control step of 20000000 ns"),
    ):
        with pytest.raises(RequestRefused, match=told):
            session.handle(asked.WorldRequest(request=wrong))
    assert ask(session, controller).clock.step_ns == 2_000_000
    ask(session, planner)
    stopped = []
    while len(stopped) < 13:  # up to 40 ms: the controller each 4 ms, the planner at 0 and 40 ms
        stamp = session.simulation.stamp
        if session.pacer.decide(stamp, 0.0).kind == "step":
            session.step()
            continue
        missing = {str(service) for service in session.pacer.missing(stamp)}
        stopped.append((stamp, missing))
        if "arm1/controller" in missing:
            token = FencingToken(epoch="e", lease=0)
            command = ArmCommand(answers=stamp, mode="velocity", values=(0.1,) * 6, token=token)
            assert session.command("arm1", command)
        else:
            assert session.command("amr1", ChassisCommand(answers=stamp, twist=STILL))
    assert [stamp for stamp, missing in stopped if "arm1/controller" in missing] == list(
        range(0, 40_000_001, 4_000_000)
    )
    assert [stamp for stamp, missing in stopped if missing == {"amr1/planner"}] == [0, PERIOD]
    assert session.gone(ServiceId("controller", "arm1"))


def test_commands_are_reported_with_the_stamp_they_answer() -> None:
    session = make_session()
    for _ in range(3):
        session.step()
    assert session.command("amr1", ChassisCommand(answers=PERIOD, twist=STILL))
    assert not session.command("amr1", ChassisCommand(answers=999 * PERIOD, twist=STILL))
    assert ask(session, asked.Inspect()).command_stamps == {"amr1": PERIOD}


def test_the_command_of_a_participant_that_has_gone_no_longer_counts() -> None:
    session = make_session()
    ask(session, join())
    session.command("amr1", ChassisCommand(answers=0, twist=Twist2(linear=1.0, angular=0.0)))
    assert session.gone(ServiceId("planner", "amr1"))
    assert session.simulation.robots["amr1"].command is None
    assert not session.gone(ServiceId("viewer", "cell"))


def test_reset_starts_a_new_run_with_the_seed_and_without_former_changes() -> None:
    session = make_session()
    first = session.simulation.digest
    ask(session, join())
    ask(session, asked.Place(name="crate", pose=Pose2(x=3, y=0, yaw=0)))
    ask(session, asked.InjectFault(target="amr1", fault="lidar_dead"))
    session.step()
    reply = ask(session, asked.Reset())
    assert (reply.clock.stamp, reply.clock.run, reply.seed, reply.participants) == (0, "run2", 4, ())
    assert reply.digest == first
    assert not session.simulation.obstacles.placed and not session.simulation.robots["amr1"].faults
    assert session.pacer.missing(0) == [ServiceId("planner", "amr1")]
    changes = session.take_changes()
    assert changes.clock and changes.outputs and changes.things
    assert ask(session, asked.Reset(seed=9)).seed == 9
    assert ask(session, asked.Reset()).seed == 9


def test_advance_is_answered_at_its_end() -> None:
    session = make_session(paused=True)
    assert session.handle(asked.WorldRequest(request=asked.Advance(duration_ns=CONTROL_STEP_NS + 1))) is None
    assert not session.clock.paused
    with pytest.raises(RequestRefused, match="already advancing to stamp 40000000"):
        session.handle(asked.WorldRequest(request=asked.Advance(duration_ns=1)))
    while session.pacer.decide(session.simulation.stamp, 0.0).kind == "step":
        session.step()
    assert session.simulation.stamp == PERIOD and session.clock.paused


def test_pause_and_speed_show_in_the_clock() -> None:
    session = make_session()
    assert ask(session, asked.Pause(paused=True)).clock.paused
    assert ask(session, asked.SetSpeed(speed=0.5)).clock.speed == 0.5
    assert session.take_changes().clock


def lockstep_session() -> Session:
    session = make_session(lockstep=True)
    ask(session, join())
    return session


def drive(session: Session, stamp: int, speed: float) -> bool:
    return session.command("amr1", ChassisCommand(answers=stamp, twist=Twist2(linear=speed, angular=0.0)))


def in_force(session: Session) -> int | None:
    command = session.simulation.robots["amr1"].command
    return None if command is None else command.answers


def test_in_lockstep_a_command_takes_effect_at_its_step_exactly() -> None:
    session = lockstep_session()
    assert drive(session, 0, 0.5)
    assert in_force(session) is None
    session.step()
    session.step()
    assert session.simulation.stamp == PERIOD and in_force(session) is None
    assert drive(session, PERIOD, 0.6), "early: it waits for its turn"
    session.step()
    assert in_force(session) == 0
    session.step()
    assert in_force(session) == 0
    session.step()
    assert session.simulation.stamp == 2 * PERIOD + CONTROL_STEP_NS and in_force(session) == PERIOD


def test_in_lockstep_the_time_at_which_an_answer_arrives_changes_no_byte() -> None:
    digests = set()
    for early in (False, True):
        session, given = lockstep_session(), 0
        while session.simulation.stamp < 6 * PERIOD:
            newest = session.simulation.stamp if early else session.simulation.stamp - PERIOD
            while given <= newest:
                assert drive(session, given, 0.1 + given * 1e-9)
                assert drive(session, given, 0.1 + given * 1e-9), "a repeated answer is taken, and changes nothing"
                given += PERIOD
            assert session.pacer.decide(session.simulation.stamp, 0.0).kind == "step"
            session.step()
        digests.add(session.simulation.digest)
    assert len(digests) == 1


def test_in_lockstep_commands_from_before_joining_do_not_count() -> None:
    session = make_session(lockstep=True, awaited=(ServiceId("planner", "amr1"),))
    assert drive(session, 0, 0.5), "how many of them come depends on the load"
    ask(session, join())
    assert session.pacer.missing(PERIOD) == [ServiceId("planner", "amr1")]
    session.step()
    assert in_force(session) is None


def test_a_command_that_waits_goes_with_its_participant_and_with_the_run() -> None:
    for end in (asked.Leave(robot="amr1", service="planner"), asked.Reset()):
        session = lockstep_session()
        assert drive(session, 0, 0.5)
        ask(session, end)
        for _ in range(3):
            session.step()
        assert in_force(session) is None
