"""The bus between processes: what is said arrives, refusals and deaths are told, and everyone ends cleanly."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any, cast

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from rackhand.bus import Bus, BusConfig, CallTimeout, Inbox, Refused, Sample, Unavailable
from rackhand.bus.inbox import MAX_OVERTAKES
from rackhand.schemas import topics
from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.chassis import Odometry
from rackhand.schemas.codec import codec_for
from rackhand.schemas.moves import (
    CancelMove,
    CreateMove,
    GetMove,
    ListMoves,
    MoveCreate,
    MoveReply,
    MoveRequest,
    PlanningState,
)
from rackhand.schemas.service import WORLD, ServiceId
from rackhand.testing.ports import free_port
from tests.bus.conftest import wait_for
from tests.bus.peer import ME

Start = Callable[[str], subprocess.Popen[bytes]]


@pytest.fixture
def bus(router: str) -> Iterator[Bus]:
    with Bus(ServiceId("sim", WORLD), BusConfig(connect=router)) as bus:
        yield bus


@pytest.fixture
def start(router: str) -> Iterator[Start]:
    started: list[subprocess.Popen[bytes]] = []

    def start(role: str) -> subprocess.Popen[bytes]:
        started.append(subprocess.Popen([sys.executable, "-m", "tests.bus.peer", router, role]))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()


@pytest.fixture
def peer(bus: Bus, start: Start) -> subprocess.Popen[bytes]:
    process = start("serve")
    wait_for(bus.inbox().watch_services(), ME)
    return process


def odometry(stamp: int) -> Odometry:
    return Odometry(
        stamp=stamp,
        pose=Pose2(x=0.0, y=0.0, yaw=0.0),
        twist=Twist2(linear=0.0, angular=0.0),
        wheel_velocities=(0.0, 0.0),
    )


def ask(request: ListMoves | GetMove | CancelMove | CreateMove) -> MoveRequest:
    return MoveRequest(request=request)


def next_sample(inbox: Inbox) -> Sample:
    event = inbox.get(timeout=20)
    assert isinstance(event, Sample)
    return event


def test_every_sample_of_a_conversation_arrives_in_order(bus: Bus, peer: subprocess.Popen[bytes]) -> None:
    inbox = bus.inbox().subscribe(topics.COMMAND, "amr1")
    publisher = bus.publisher(topics.ODOMETRY, "amr1")
    first = None
    while first is None:  # until the two have found each other: a stream has no memory
        publisher.put(odometry(0))
        first = inbox.get(timeout=0.2)
    for stamp in range(1, 500):
        publisher.put(odometry(stamp))
        answer = next_sample(inbox).message.answers
        while answer < stamp:
            answer = next_sample(inbox).message.answers
        assert answer == stamp


def test_a_late_joiner_gets_the_last_latched_value_and_then_each_new_one(router: str, bus: Bus) -> None:
    publisher = bus.publisher(topics.PLANNING_STATE, "amr1")
    for action in (1, 2, 3):
        publisher.put(PlanningState(stamp=0, action_id=action))
    with Bus(ServiceId("gateway", "cell"), BusConfig(connect=router)) as late:
        inbox = late.inbox().subscribe(topics.PLANNING_STATE)
        assert next_sample(inbox).message.action_id == 3
        publisher.put(PlanningState(stamp=0, action_id=4))
        assert next_sample(inbox).message.action_id == 4


def test_calls_are_answered_refused_or_time_out(bus: Bus, peer: subprocess.Popen[bytes]) -> None:
    assert bus.call(topics.MOVES, ask(ListMoves()), "amr1") == MoveReply(moves=())
    with pytest.raises(Refused, match="not_found: no such move"):
        bus.call(topics.MOVES, ask(GetMove(id=4)), "amr1")
    with pytest.raises(CallTimeout):
        bus.call(topics.MOVES, ask(CancelMove()), "amr1", timeout=0.2)
    with pytest.raises(Refused, match="internal: the service stopped before it answered"):
        bus.call(topics.MOVES, ask(CreateMove(move=MoveCreate(target_ori=0.0))), "amr1")
    with pytest.raises(Unavailable):
        bus.call(topics.MOVES, ask(ListMoves()), "nobody")


def test_calls_from_asyncio_run_side_by_side(bus: Bus, peer: subprocess.Popen[bytes]) -> None:
    async def scenario() -> None:
        replies = await asyncio.gather(*(bus.acall(topics.MOVES, ask(ListMoves()), "amr1") for _ in range(100)))
        assert replies == [MoveReply(moves=())] * 100
        with pytest.raises(Unavailable):
            await bus.acall(topics.MOVES, ask(ListMoves()), "nobody")
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(bus.acall(topics.MOVES, ask(CancelMove()), "amr1", timeout=30), 0.2)

    asyncio.run(scenario())


def test_the_asyncio_stream_receives_what_the_loop_receives(bus: Bus, router: str) -> None:
    async def scenario() -> list[int]:
        with Bus(ServiceId("gateway", "cell"), BusConfig(connect=router)) as other:
            inbox = other.inbox().subscribe(topics.MAP).subscribe(topics.PLANNING_STATE)
            publisher = bus.publisher(topics.PLANNING_STATE, "amr2")
            seen: list[int] = []
            publisher.put(PlanningState(stamp=0, action_id=0))
            async for event in inbox.stream():
                assert isinstance(event, Sample)
                seen.append(event.message.action_id)
                if len(seen) == 20:
                    return seen
                publisher.put(PlanningState(stamp=0, action_id=len(seen)))
        return seen

    assert asyncio.run(asyncio.wait_for(scenario(), 30)) == list(range(20))


def test_malformed_payloads_are_counted_and_refused_and_stop_nothing(
    router: str, bus: Bus, peer: subprocess.Popen[bytes]
) -> None:
    """Samples of one session arrive in order: valid ones of the hostile session's own mark where its garbage ends."""
    inbox = bus.inbox().subscribe(topics.PLANNING_STATE, "amr1")
    key, codec = topics.PLANNING_STATE.key_for("amr1"), codec_for(PlanningState)
    with zenoh.open(BusConfig(connect=router).zenoh_config()) as hostile:
        hostile.liveliness().declare_subscriber(ME.key, history=True).recv()  # it and the peer have found each other
        found = False
        while not found:  # until it and this session have, too
            hostile.put(key, codec.dumps(PlanningState(stamp=1)))
            event = inbox.get(timeout=0.1)
            found = isinstance(event, Sample) and event.message.stamp == 1
        for payload in (b"", b"\xc1", b"\x91" * 100_000, b"\x81\xa5stamp\xff"):
            replies = list(hostile.get(topics.MOVES.key_for("amr1"), payload=payload, timeout=5.0))
            assert b"malformed" in replies[0].err.payload.to_bytes()
            hostile.put(key, payload)
        hostile.put(key, codec.dumps(PlanningState(stamp=2)))
        while next_sample(inbox).message.stamp != 2:
            pass
    assert inbox.malformed["moves/planning_state"] == 4
    assert bus.call(topics.MOVES, ask(ListMoves()), "amr1") == MoveReply(moves=())


def test_a_reader_that_sleeps_holds_up_no_other_topic(router: str, bus: Bus) -> None:
    """Ten thousand unread odometries of the same session, and the latched state still comes at once."""
    with Bus(ServiceId("viewer", "cell"), BusConfig(connect=router)) as reader:
        asleep = reader.inbox().subscribe(topics.ODOMETRY, depth=4)
        awake = reader.inbox().subscribe(topics.PLANNING_STATE)
        state = bus.publisher(topics.PLANNING_STATE, "amr1")
        state.put(PlanningState(stamp=0, action_id=0))
        assert next_sample(awake).message.action_id == 0
        flood = bus.publisher(topics.ODOMETRY, "amr1")
        for stamp in range(10_000):
            flood.put(odometry(stamp))
        state.put(PlanningState(stamp=0, action_id=1))
        assert next_sample(awake).message.action_id == 1
        flood.put(odometry(10_000))
        stamps = [next_sample(asleep).message.stamp]
        while stamps[-1] < 10_000:
            stamps.append(next_sample(asleep).message.stamp)
        assert len(stamps) <= 5
        assert asleep.dropped > 0


def test_a_call_waits_for_a_service_that_is_only_starting(bus: Bus, start: Start) -> None:
    nothing = MoveRequest(request=ListMoves())
    with pytest.raises(Unavailable):
        bus.call_when_served(topics.MOVES, nothing, "amr1", patience=0.2)
    start("serve")
    assert bus.call_when_served(topics.MOVES, nothing, "amr1", patience=60.0).moves == ()


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_death_is_reported_and_the_dead_are_unavailable_at_once(
    bus: Bus, peer: subprocess.Popen[bytes], how: signal.Signals
) -> None:
    inbox = bus.inbox().watch_services()
    wait_for(inbox, ME)
    peer.send_signal(how)
    wait_for(inbox, ME, alive=False)
    assert peer.wait(timeout=10) == (0 if how != signal.SIGKILL else -9)
    asked = time.monotonic()
    with pytest.raises(Unavailable):
        bus.call(topics.MOVES, ask(ListMoves()), "amr1", timeout=30)
    assert time.monotonic() - asked < 15  # not the time-out


def test_an_uncaught_exception_ends_the_process(start: Start) -> None:
    assert start("fail").wait(timeout=20) == 1


def test_a_service_may_start_before_the_router() -> None:
    """It opens, waits in the background, and is on the bus once the router is."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with Bus(ServiceId("sim", WORLD), BusConfig(connect=endpoint)) as early:
        inbox = early.inbox().watch_services()
        process = subprocess.Popen([sys.executable, "-m", "rackhand.bus.router", "--listen", endpoint])
        try:
            wait_for(inbox, ServiceId("router", "cell"))
        finally:
            process.terminate()
            assert process.wait(timeout=10) == 0


def test_peers_keep_talking_while_the_router_is_gone() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    process = subprocess.Popen([sys.executable, "-m", "rackhand.bus.router", "--listen", endpoint])
    with (
        Bus(ServiceId("sim", WORLD), BusConfig(connect=endpoint)) as one,
        Bus(ServiceId("gateway", "cell"), BusConfig(connect=endpoint)) as other,
    ):
        inbox = other.inbox().watch_services()
        one.announce()
        wait_for(inbox, ServiceId("sim", WORLD))
        states = other.inbox().subscribe(topics.PLANNING_STATE)
        publisher = one.publisher(topics.PLANNING_STATE, "amr1")
        publisher.put(PlanningState(stamp=0))
        next_sample(states)
        process.kill()
        process.wait()
        wait_for(inbox, ServiceId("router", "cell"), alive=False)
        publisher.put(PlanningState(stamp=1))
        assert next_sample(states).message.stamp == 1


def test_a_service_tells_what_it_read_lost_and_could_not_parse(bus: Bus, router: str) -> None:
    """A slow reader of a stream: of twenty samples four are kept, sixteen count as dropped, one payload is none."""
    stats = bus.inbox().subscribe(topics.BUS_STATS, "amr1")
    config = BusConfig(connect=router)
    with Bus(ServiceId("planner", "amr1"), config) as planner, zenoh.open(config.zenoh_config()) as stranger:
        slow = planner.inbox().subscribe(topics.COMMAND, "amr1").subscribe(topics.ODOMETRY, "amr1", depth=4)
        publisher = bus.publisher(topics.ODOMETRY, "amr1")
        while slow.get(timeout=0.2) is None:
            publisher.put(odometry(0))
        publisher.put(odometry(1))
        while next_sample(slow).message.stamp != 1:
            pass
        before = planner.stats()
        for stamp in range(20):
            publisher.put(odometry(stamp))
        while planner.stats().dropped < before.dropped + 16:
            assert planner.stats().received == before.received
        stranger.put(topics.COMMAND.key_for("amr1"), b"\xc1")
        while planner.stats().malformed == 0:
            slow.get(timeout=0.2)
        planner.announce()
        told = next_sample(stats)
    assert (told.robot, told.message.service) == ("amr1", "planner")
    assert told.message.received == before.received + 4
    assert told.message.dropped == before.dropped + 16
    assert told.message.malformed == 1


@given(st.lists(st.sampled_from(["state", "stop", "command", "other", "get"]), max_size=60))
def test_low_priority_requests_wait_for_all_else_and_none_is_lost(happenings: list[str]) -> None:
    inbox = Inbox(cast(Bus, None))
    pushers = {
        name: inbox._pusher(inbox._add_source(4, lambda item: item, low_priority=name in ("command", "other")))
        for name in ("state", "stop", "command", "other")
    }
    waiting: list[tuple[str, int]] = []
    overtakes = 0
    for number, name in enumerate([*happenings, *["get"] * 60]):
        if name != "get":
            mine = [item for item in waiting if item[0] == name]
            if len(mine) == 4:
                waiting.remove(mine[0])  # the oldest makes way
            waiting.append((name, number))
            pushers[name]((name, number))
            continue
        heard: Any = inbox.get(timeout=0)
        if not waiting:
            assert heard is None
            continue
        urgent = [item for item in waiting if item[0] in ("state", "stop")]
        assert heard == next(item for item in (urgent or waiting) if item[0] == heard[0]), "in order of arrival"
        assert not urgent or heard in urgent or overtakes == MAX_OVERTAKES
        overtakes = overtakes + 1 if heard in urgent and len(urgent) < len(waiting) else 0
        waiting.remove(heard)


def test_a_reader_that_cannot_keep_up_serves_low_priority_requests_all_the_same() -> None:
    inbox = Inbox(cast(Bus, None))
    state = inbox._pusher(inbox._add_source(4, lambda item: item))
    request = inbox._pusher(inbox._add_source(4, lambda item: item, low_priority=True))
    request("request")
    heard = []
    for _ in range(3 * MAX_OVERTAKES):
        state("state")
        state("state")
        heard.append(inbox.get(timeout=0))
    assert heard.count("request") == 1 and heard.index("request") <= MAX_OVERTAKES  # type: ignore[arg-type]
