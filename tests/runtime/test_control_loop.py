"""The control loop, with a core that writes down what it is asked."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from rackhand.bus import Posted, Presence, Request, Sample
from rackhand.runtime.control_loop import READ_AHEAD, ControlLoop, LoopSettings
from rackhand.schemas import topics
from rackhand.schemas.motion import ArmCommand, ArmState, CrfAnswer, CrfCall, FencingToken
from rackhand.schemas.service import ServiceId
from rackhand.schemas.world import Clock
from tests.runtime.list_bus import Asked, ListBus

MS = 1_000_000
ME, DRIVER = ServiceId("controller", "arm1"), ServiceId("driver", "arm1")


@dataclass
class Core:
    """Answers every state; what happens to it is in ``log``."""

    bus: ListBus
    log: list[Any] = field(default_factory=list)
    failing: list[Exception] = field(default_factory=list)
    ready: bool = True
    work: int = 0  # polls until the work beside the loop is done
    stamp: int = 0

    @property
    def busy(self) -> bool:
        return self.work > 0

    def take(self, state: ArmState) -> None:
        self.stamp = state.stamp

    def on_clock(self, clock: Clock) -> None:
        self.log.append(("clock", clock.run))

    def tick(self, lockstep: bool) -> ArmCommand | None:
        if self.failing:
            raise self.failing.pop()
        self.log.append(("tick", self.stamp // MS, lockstep))
        token = FencingToken(epoch="e", lease=0)
        return ArmCommand(answers=self.stamp, mode="velocity", values=(0.0,) * 6, token=token)

    def tick_failed(self, error: Exception) -> None:
        self.log.append(("failed", str(error)))

    def reset(self, why: str) -> None:
        self.log.append(("reset", why))

    def set_driver_fault(self, fault: str) -> None:
        self.log.append(("fault", fault))

    def poll(self) -> None:
        self.work = max(0, self.work - 1)

    def wait(self, seconds: float) -> None:
        self.log.append(("wait", seconds))

    def publish(self) -> None: ...


@pytest.fixture
def core() -> Core:
    return Core(ListBus())


def run(core: Core, *batches: list[Any]) -> None:
    core.bus.batches = [list(batch) for batch in batches]
    settings = LoopSettings(ME, "the arm driver", 4 * MS)
    loop = ControlLoop(core.bus, core, topics.ARM_COMMAND, settings, lambda: core.bus.now)  # type: ignore[arg-type]
    loop.measure(topics.ARM_STATE, core.take, triggers=True)

    def serve(request: Request[CrfCall, CrfAnswer]) -> None:
        if request.message.text == "fail":
            raise OSError("broken")
        core.log.append(("request", request.message.text))

    loop.on_request(topics.MOTION, serve)
    loop.on_request(topics.MOTION_STOP, serve, at_once=True)
    loop.run()


def state(milliseconds: int) -> Sample:
    values = (0.0,) * 6
    message = ArmState(stamp=milliseconds * MS, q=values, dq=values, efforts=values, wrench=values)
    return Sample(topics.ARM_STATE, "arm1", message)


def clock(run: str, **more: Any) -> Sample:
    fields = {"stamp": 0, "step_ns": MS, "speed": 1.0, "paused": False, "lockstep": True, "unix_ns": 0} | more
    return Sample(topics.CLOCK, "world", Clock(run=run, **fields))


def asked(text: str, query: Any = topics.MOTION) -> Asked:
    return Asked(query, CrfCall(session="s", text=text), "arm1")


def commands(core: Core) -> list[int]:
    return [command.answers // MS for command in core.bus.published(topics.ARM_COMMAND)]


def test_the_newest_of_what_waits_is_answered_once(core: Core) -> None:
    run(core, [state(t) for t in (0, 2, 4, 6, 8)], [state(8)], [state(10)], [state(12)])
    assert commands(core) == [8, 8, 12]
    assert [entry for entry in core.log if entry[0] == "tick"] == [("tick", 8, False), ("tick", 12, False)]


def test_in_lockstep_every_period_is_answered_by_what_was_known_of_it(core: Core) -> None:
    run(core, [clock("a")], [state(0), state(2), state(4), asked("move"), state(8)])
    assert commands(core) == [0, 4, 8]
    done = [entry[:2] for entry in core.log if entry[0] in ("tick", "request")]
    assert done == [("tick", 0), ("tick", 4), ("request", "move"), ("tick", 8)]


def test_a_flood_of_events_does_not_put_a_tick_off_for_ever(core: Core) -> None:
    run(core, [state(0), *[Posted(lambda _: None, None)] * (3 * READ_AHEAD), state(4)])
    assert commands(core) == [0, 4]


def test_a_measurement_is_answered_before_a_request_and_after_one_that_waits_for_nothing(core: Core) -> None:
    run(core, [state(0), asked("move"), state(4), asked("stop", topics.MOTION_STOP)])
    done = [entry[:2] for entry in core.log if entry[0] in ("tick", "request")]
    assert done == [("tick", 0), ("request", "move"), ("request", "stop"), ("tick", 4)]


def test_a_handler_that_raises_refuses_its_request_only(core: Core) -> None:
    first, second = asked("fail"), asked("move")
    run(core, [first, second, state(0)])
    assert first.answer == ("internal", "the controller failed to answer; see its log")
    assert ("request", "move") in core.log
    assert commands(core) == [0]


def test_a_tick_that_raises_commands_what_the_core_says_instead(core: Core) -> None:
    core.failing = [ZeroDivisionError("by zero")]
    run(core, [state(0)], [state(0)], [state(4)])
    assert ("failed", "by zero") in core.log
    assert commands(core) == [4], "and nothing is repeated of it"


def test_a_driver_that_disconnects_voids_all_and_is_answered_again(core: Core) -> None:
    run(core, [Presence(DRIVER, True)], [state(40)], [state(44), Presence(DRIVER, False)], [Presence(DRIVER, True)],
        [state(40)])  # fmt: skip
    assert commands(core) == [40, 40], "what was measured before it disconnected is not answered after"
    assert [entry for entry in core.log if entry[0] in ("reset", "fault")] == [
        ("fault", ""),
        ("reset", "the arm driver disconnected"),
        ("fault", "the arm driver disconnected"),
        ("fault", ""),
    ]


def test_another_robot_s_driver_is_not_this_one_s(core: Core) -> None:
    run(core, [Presence(DRIVER, True)], [Presence(ServiceId("driver", "arm2"), False)], [state(0)])
    assert [entry for entry in core.log if entry[0] == "reset"] == []


def test_a_driver_that_falls_silent_voids_all_without_any_event(core: Core) -> None:
    run(core, [state(0)], [0.6, state(4)], [0.6, state(8)], [5.0], [state(12)])
    assert [entry for entry in core.log if entry[0] == "reset"] == [
        ("reset", "the arm driver sent no measurement for 1.5 s")
    ]
    assert commands(core) == [0, 4, 8, 12]


def test_a_loop_that_falls_behind_does_not_take_its_driver_for_silent(core: Core) -> None:
    """What waits in the inbox when it wakes up is read before the driver is judged."""
    late = Posted(lambda _: setattr(core.bus, "now", core.bus.now + 30.0), None)
    run(core, [state(0)], [late, *[state(4)] * (2 * READ_AHEAD)], [state(8)])
    assert [entry for entry in core.log if entry[0] == "reset"] == []


def test_work_beside_the_loop_is_polled_until_it_is_done(core: Core) -> None:
    core.work = 3
    run(core, [], [], [], [], [state(0)])
    assert core.work == 0
    assert ("wait", 0.01) in core.log
    assert commands(core) == [0]


def test_lockstep_is_reported_by_the_clock_and_joined_when_the_core_is_ready(core: Core) -> None:
    core.ready = False
    run(core, [Presence(ServiceId("sim", "world"), True)], [clock("a"), state(0)])
    assert core.bus.calls == []
    assert ("tick", 0, True) in core.log
    core.ready = True
    run(core, [Presence(ServiceId("sim", "world"), True)], [clock("a"), state(0)], [clock("a")])
    ((_, join),) = core.bus.calls
    assert (join.service, join.period_ns) == ("controller", 4 * MS)
