"""The simulator on a real bus: what it publishes, whom it waits for, and what it answers."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from itertools import count
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from rackhand.bus import Bus, BusConfig, Inbox, Presence, Refused, Sample
from rackhand.schemas import topics
from rackhand.schemas import world as asked
from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.lift import CallLift, GoToFloor, LiftModel, LiftRequest, LiftState, ReleaseLift
from rackhand.schemas.motion import ArmCommand, FencingToken
from rackhand.schemas.service import CELL, DRIVER, ServiceId
from rackhand.services.sim.pacing import Pacer
from rackhand.services.sim.service import SimService
from rackhand.services.sim.session import Run, Session
from rackhand.services.sim.simulation import CONTROL_STEP_NS
from rackhand.services.sim.world.change_commands import add_change_commands
from rackhand.worlds.world_model import World
from tests.bus.conftest import free_port
from tests.sim.helpers import make_simulation, make_world

PLANNER = ServiceId("planner", "amr1")
PERIOD = 2 * CONTROL_STEP_NS
WORLD = make_world(statics={"wall": {"kind": "wall", "start": (9, -9), "end": (9, 9)}})


class Peer:
    """A client of the simulator's, on the one bus they share."""

    def __init__(self, bus: Bus, endpoint: str) -> None:
        self.bus, self.endpoint = bus, endpoint
        self.heard: Inbox = bus.inbox()
        self.heard.subscribe(topics.ODOMETRY, "amr1", depth=1024).watch_services()
        self.commands = bus.publisher(topics.COMMAND, "amr1")

    def ask(self, request: Any, timeout: float = 10.0) -> asked.WorldReply:
        return self.bus.call(topics.WORLD_CONTROL, asked.WorldRequest(request=request), timeout=timeout)

    def join(self) -> asked.WorldReply:
        return self.ask(asked.Join(robot="amr1", service="planner", period_ns=PERIOD))

    def next_odometry(self) -> Any:
        while not isinstance(event := self.heard.get(timeout=20), Sample):
            assert event is not None, "the simulator is silent"
        return event.message

    def answer_until(self, stamp: int) -> None:
        """Answer each period's odometry, as a planner does, up to that of ``stamp``."""
        answered = -1
        while answered < stamp:
            odometry = self.next_odometry()
            if odometry.stamp % PERIOD == 0 and odometry.stamp <= stamp:
                answered = odometry.stamp
                twist = Twist2(linear=0.4, angular=0.1 * odometry.pose.x)
                self.commands.put(ChassisCommand(answers=answered, twist=twist))


@pytest.fixture
def start() -> Iterator[Any]:
    """Start a simulator; called with the world and the pace, returns a peer of it."""
    running: list[tuple[Bus, Bus, threading.Thread]] = []

    def run(world: World = WORLD, **pace: Any) -> Peer:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        names = count()
        session = Session(
            build=lambda seed: make_simulation(world, seed),
            new_run=lambda: Run(f"run{next(names)}", 0),
            seed=1,
            pacer=Pacer(world.control_step_ns, **({"speed": None} | pace)),
        )
        sim_bus = Bus(ServiceId("sim", "world"), BusConfig(listen=endpoint, connect=""))
        thread = threading.Thread(target=serve, args=(sim_bus, session))
        peer_bus = Bus(ServiceId("probe", CELL), BusConfig(connect=endpoint))
        peer_bus.__enter__()
        peer = Peer(peer_bus, endpoint)
        thread.start()
        running.append((sim_bus, peer_bus, thread))
        while (event := peer.heard.get(timeout=20)) != Presence(ServiceId("sim", "world"), True):
            assert event is not None, "the simulator did not come"
        return peer

    yield run
    for sim_bus, peer_bus, thread in running:
        sim_bus.stop()
        thread.join(10)
        assert not thread.is_alive()
        peer_bus.__exit__(None, None, None)


def serve(bus: Bus, session: Session) -> None:
    with bus:
        SimService(bus, session).run()


def test_it_is_the_driver_of_each_robot_until_it_ends(start: Any) -> None:
    arm = {"kind": "ur5e", "pose": (3, 3, 0)}
    peer = start(make_world(arms={"arm1": arm}))
    drivers = {ServiceId(DRIVER, "amr1"), ServiceId(DRIVER, "arm1")}
    inbox = peer.bus.inbox().watch_services()
    there: set[ServiceId] = set()
    while not drivers <= there:
        event = inbox.get(timeout=20)
        assert event is not None, f"of {drivers} only {there}"
        if isinstance(event, Presence) and event.alive:
            there.add(event.service)


def test_a_driver_that_is_gone_has_no_token_measures_nothing_and_is_waited_for_by_nobody(start: Any) -> None:
    peer = start(awaited=(PLANNER,), lockstep=True)
    peer.ask(asked.Pause(paused=True))
    peer.join()
    driver = ServiceId(DRIVER, "amr1")
    gone = asked.InjectFault(target="amr1", fault="driver_gone")
    assert peer.ask(gone).participants == ()
    while (event := peer.heard.get(timeout=20)) != Presence(driver, False):
        assert event is not None, "the token of the driver stays"
    peer.ask(asked.Advance(duration_ns=10 * PERIOD))  # nobody answers
    late = ChassisCommand(answers=0, twist=Twist2(linear=0.4, angular=0.0))
    peer.commands.put(late)
    peer.ask(gone.model_copy(update={"active": False}))
    while (event := peer.heard.get(timeout=20)) != Presence(driver, True):
        assert not isinstance(event, Sample), f"a driver that is gone measured {event}"
    peer.join()
    assert peer.next_odometry().stamp == 10 * PERIOD


def test_it_waits_at_zero_until_all_have_joined_and_publishes_the_step_to_a_participant_that_joins(start: Any) -> None:
    peer = start(awaited=(PLANNER,), lockstep=True)
    assert peer.ask(asked.Inspect()).clock.stamp == 0
    assert peer.join().participants == ("amr1/planner",)
    assert peer.next_odometry().stamp == 0
    peer.answer_until(10 * PERIOD)
    assert peer.ask(asked.Inspect()).command_stamps == {"amr1": 10 * PERIOD}


def test_lockstep_runs_over_the_bus_are_the_same_to_the_byte(start: Any) -> None:
    peer = start(awaited=(PLANNER,), lockstep=True)
    digests = set()
    for _ in range(2):
        assert peer.ask(asked.Pause(paused=True)).clock.paused
        peer.ask(asked.Reset(seed=5))
        peer.join()
        advance = threading.Thread(target=peer.ask, args=(asked.Advance(duration_ns=30 * PERIOD),))
        advance.start()
        peer.answer_until(30 * PERIOD)
        advance.join(10)
        reply = peer.ask(asked.Inspect())
        assert reply.clock.stamp == 30 * PERIOD and reply.clock.paused
        digests.add(reply.digest)
    assert len(digests) == 1


def test_a_step_that_nobody_answers_is_published_again(start: Any) -> None:
    peer = start(awaited=(PLANNER,), lockstep=True)
    peer.join()
    while peer.next_odometry().stamp < PERIOD:  # the command latency
        pass
    assert [peer.next_odometry().stamp for _ in range(2)] == [PERIOD, PERIOD]


def test_it_continues_without_a_participant_that_leaves(start: Any) -> None:
    peer = start(awaited=(PLANNER,), lockstep=True)
    peer.join()
    peer.ask(asked.Leave(robot="amr1", service="planner"))
    while peer.next_odometry().stamp < 10 * PERIOD:
        pass


def test_requests_are_answered_while_it_is_paused_and_refusals_carry_code_and_text(start: Any) -> None:
    peer = start(paused=True)
    assert peer.ask(asked.Place(name="crate", pose=Pose2(x=3, y=0, yaw=0))).clock.stamp == 0
    with pytest.raises(Refused, match="invalid: 'wall' is already used in this world"):
        peer.ask(asked.Place(name="wall", pose=Pose2(x=3, y=0, yaw=0)))
    with pytest.raises(Refused, match="not_found"):
        peer.ask(asked.Remove(name="wall"))
    assert peer.ask(asked.Advance(duration_ns=PERIOD)).clock.stamp == PERIOD


def test_models_and_scene_are_latched(start: Any) -> None:
    peer = start(paused=True)
    peer.ask(asked.Place(name="crate", pose=Pose2(x=3, y=0, yaw=0)))
    late = peer.bus.inbox().subscribe(topics.CHASSIS_MODEL, "amr1").subscribe(topics.SCENE)
    messages = {}
    while len(messages) < 2 or "crate" not in {geom.body for geom in messages[topics.SCENE.name].geoms}:
        event = late.get(timeout=20)
        assert isinstance(event, Sample), "nothing is latched"
        messages[event.topic.name] = event.message
    assert messages[topics.CHASSIS_MODEL.name].name == "longjack"


def test_an_advance_that_is_cut_short_is_refused(start: Any) -> None:
    peer = start(awaited=(PLANNER,), paused=True)  # nobody joins: it cannot arrive
    refusals = []

    def advance() -> None:
        try:
            peer.ask(asked.Advance(duration_ns=PERIOD))
        except Refused as refused:
            refusals.append(refused.code)

    thread = threading.Thread(target=advance)
    thread.start()
    while peer.ask(asked.Inspect()).clock.paused:
        pass
    peer.ask(asked.Pause(paused=True))
    thread.join(10)
    assert refusals == ["precondition"]


def test_an_arm_in_lockstep_over_the_bus_gives_the_same_bytes(start: Any) -> None:
    """A controller of 4 ms beside a chassis that nobody commands; the same commands, the same digest."""
    period, until = 4_000_000, 200_000_000
    world = make_world(arms={"arm1": {"kind": "ur5e", "pose": (0, 3, 0), "mount": 0.6}})
    controller = ServiceId("controller", "arm1")
    peer = start(world, awaited=(controller,), lockstep=True)
    states = peer.bus.inbox().subscribe(topics.ARM_STATE, "arm1", depth=1024)
    commands = peer.bus.publisher(topics.ARM_COMMAND, "arm1")
    digests = set()
    for run in range(2):
        assert peer.ask(asked.Pause(paused=True)).clock.paused
        peer.ask(asked.Reset(seed=5))
        peer.ask(asked.Join(robot="arm1", service="controller", period_ns=period))
        advance = threading.Thread(target=peer.ask, args=(asked.Advance(duration_ns=until),))
        advance.start()
        answered = -1
        while answered < until:
            event = states.get(timeout=20)
            assert isinstance(event, Sample), "the simulator is silent"
            state = event.message
            if state.stamp % period == 0 and state.stamp == answered + (period if answered >= 0 else 1):
                answered = state.stamp
                values = tuple(position + 0.001 for position in state.q)
                token = FencingToken(epoch=f"run{run}", lease=1)
                commands.put(ArmCommand(answers=answered, mode="position", values=values, token=token))
        advance.join(10)
        digests.add(peer.ask(asked.Inspect()).digest)
    assert len(digests) == 1


def test_the_command_line_changes_the_world_and_says_why_not(start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    kinds = {"standard": {"size": (0.83, 0.83), "underside": 0.28, "height": 1.4, "mass": 90}}
    racks = {"rack_1": {"kind": "standard", "pose": (3, 0, 0)}}
    peer = start(make_world(rack_kinds=kinds, racks=racks), paused=True)
    monkeypatch.setenv("RACKHAND_BUS_CONNECT", peer.endpoint)
    objects = peer.bus.inbox().subscribe(topics.OBJECTS)
    tool = typer.Typer()
    add_change_commands(tool)

    def run(command: str) -> tuple[int, str]:
        result = CliRunner().invoke(tool, command.split())
        return result.exit_code, result.output.strip().splitlines()[-1]  # above it is the log of the simulator

    assert run("move rack_1 --at -3 2.5 0.5") == (0, "done at 0.00 s")
    told = objects.get(timeout=20)
    assert isinstance(told, Sample)
    assert next(t for t in told.message.objects if t.name == "rack_1").position == (-3.0, 2.5, 0.0)
    assert run("fault leg_hidden rack_1 --part 2") == (0, "done at 0.00 s")
    assert run("push rack_1 --impulse 0 -20") == (0, "done at 0.00 s")
    assert run("move rack_1 --at 0.3 0.4 0") == (
        2,
        "world: 'rack_1' would overlap 'amr1' at x 0.300, y 0.400, yaw 0.000",
    )
    assert run("fault gremlins rack_1")[1].startswith(
        "world: request.fault.fault: fault 'gremlins' is not known; known: ["
    )
    assert run("inspect") == (0, "}")


def test_a_lift_is_served_on_the_bus(start: Any) -> None:
    floors = {"floor1": (0, 5, 0), "floor2": (20, 5, 0)}
    kind = {"floors": floors, "cabin": (2, 2), "door": 1.2, "door_at": 1.1, "travel": 1.0, "door_time": 1.0}
    peer = start(make_world(floors={"floor2": {"bounds": (15, 0, 25, 10)}}, lifts={"lift_1": kind}))
    states = peer.bus.inbox().subscribe(topics.LIFT_STATE, "lift_1", depth=1024).subscribe(topics.LIFT_MODEL, "lift_1")

    def lift(request: Any) -> LiftState:
        return peer.bus.call(topics.LIFT, LiftRequest(request=request), "lift_1", timeout=10.0)

    assert lift(CallLift(client="amr1", floor="floor2")).holder == "amr1"
    seen: list[Any] = []
    while not any(isinstance(m, LiftState) and (m.floor, m.door) == ("floor2", "open") for m in seen):
        event = states.get(timeout=20)
        assert isinstance(event, Sample)
        seen.append(event.message)
    assert [f.name for m in seen if isinstance(m, LiftModel) for f in m.floors] == ["floor1", "floor2"]
    with pytest.raises(Refused, match="'b' does not have the lift: 'amr1' has it"):
        lift(GoToFloor(client="b", floor="floor1"))
    assert lift(ReleaseLift(client="amr1")).holder is None
