"""The loop of a service that commands a robot: measurements in, one command each period out, requests between them.

One thread, one inbox. The loop knows time, the driver and the bus; the ``Core`` it runs decides.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from rackhand.bus import Bus, Event, Request
from rackhand.bus.log import get_logger
from rackhand.runtime.driver_link import DriverLink
from rackhand.runtime.lockstep import LockstepParticipant
from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.schemas.refusal import RefusalCode
from rackhand.schemas.service import DRIVER, WORLD, ServiceId
from rackhand.schemas.topics import Query, Topic
from rackhand.schemas.world import Clock

log = get_logger(__name__)

C = TypeVar("C", bound=Message)
C_co = TypeVar("C_co", bound=Message, covariant=True)
M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

READ_AHEAD = 64  # events taken in before a tick: it answers the newest measurement, and is not put off for ever
POLL = 0.01  # s between looks at work that a busy core does beside the loop


class Core(Protocol[C_co]):
    """What a control loop runs. It sees no bus; what it raises ends neither the loop nor another request."""

    @property
    def ready(self) -> bool:
        """Whether it could answer the driver. Only then a simulator is asked to wait for it."""

    @property
    def busy(self) -> bool:
        """Whether it has work beside the loop, whose end ``poll`` would notice."""

    def on_clock(self, clock: Clock) -> None:
        """The newest clock."""

    def tick(self, lockstep: bool) -> C_co | None:
        """The command that answers the newest measurement; None commands nothing, which stops the machine.

        ``lockstep``: the driver waits for the answer.
        """

    def tick_failed(self, error: Exception) -> C_co | None:
        """The command in place of that of a tick that raised."""

    def reset(self, why: str) -> None:
        """All measurements so far are void: the driver disconnected, fell silent or restarted."""

    def set_driver_fault(self, fault: str) -> None:
        """Why the driver is not alive; empty when it is alive again."""

    def poll(self) -> None:
        """After the command is sent: what may take place between ticks."""

    def wait(self, seconds: float) -> None:
        """Wait, so long at most, for the work beside the loop."""

    def publish(self) -> None:
        """Send all that is to be published and replied by now."""


@dataclass(frozen=True)
class LoopSettings:
    """``driver`` is how texts call the driver; ``period_ns``: between commands, of stamps."""

    service: ServiceId
    driver: str
    period_ns: int


class ControlLoop(Generic[C]):
    """Runs ``core`` on the bus. Register measurements and queries, then ``run`` until the bus stops."""

    def __init__(
        self,
        bus: Bus,
        core: Core[C],
        command: Topic[C],
        settings: LoopSettings,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._bus, self._core, self._service, self._monotonic = bus, core, settings.service, monotonic
        self._robot = settings.service.robot
        self._link = DriverLink(settings.driver, settings.period_ns)
        self._lockstep = LockstepParticipant(bus, settings.service, settings.period_ns)
        self._command = bus.publisher(command, self._robot)
        self._stamp: int | None = None
        self._answer: C | None = None
        self._at_once: set[str] = set()
        self._fault: str | None = None
        self._last_error = ""
        self.inbox = bus.inbox()
        self.inbox.on(topics.CLOCK, self._on_clock, WORLD)
        self.inbox.on_presence(self._on_presence)

    # -- registration ------------------------------------------------------------------------------------------------

    def measure(self, topic: Topic[Any], take: Callable[[Any], None], triggers: bool = False) -> None:
        """Give each measurement of a topic to ``take``. One of a topic that ``triggers`` asks for a command."""
        from_driver = topic.publisher == DRIVER

        def measured(_robot: str, message: Any) -> None:
            self._void_if(self._link.measured(topic.name, message.stamp, self._monotonic(), from_driver))
            take(message)
            if triggers:
                self._stamp = message.stamp

        self.inbox.on(topic, measured, self._robot)

    def on(self, topic: Topic[M], take: Callable[[M], None]) -> None:
        """Give each message of a topic that belongs to no instant to ``take``."""
        self.inbox.on(topic, lambda _robot, message: take(message), self._robot)

    def on_request(
        self,
        query: Query[Q, R],
        serve: Callable[[Request[Q, R]], None],
        low_priority: bool = False,
        at_once: bool = False,
    ) -> None:
        """Serve a query. A measurement received before a request is answered before it is served, so that a run does
        not depend on how many events wait in the inbox; ``at_once`` is for requests that wait for nothing."""
        if at_once:
            self._at_once.add(query.name)
        self.inbox.on_request(query, serve, self._robot, low_priority)

    # -- the loop ----------------------------------------------------------------------------------------------------

    def run(self) -> None:
        self._core.publish()
        self._bus.announce()
        log.info("ready", robot=self._robot)
        while not self._bus.stopping:
            event = self._next()
            drained = event is None
            for _ in range(READ_AHEAD):
                if event is None:
                    break
                self.handle(event)
                event = self.inbox.get(0)
                drained = event is None
            if event is not None:
                self.handle(event)
            self._tick_if_due()
            if drained:
                self._void_if(self._link.check(self._monotonic()))
            self._core.poll()
            self._core.publish()
            if self._core.ready:
                self._lockstep.join_if_due()

    def _next(self) -> Event | None:
        """The next event; None when the bus stops, the driver is silent for too long, or a busy core is due."""
        left = self._link.seconds_left(self._monotonic())
        if not self._core.busy:
            return self.inbox.get(None if left is None else max(0.0, left))
        event = self.inbox.get(POLL)
        if event is None:
            self._core.wait(POLL)
        return event

    def handle(self, event: Event) -> None:
        """Take in one event. What goes wrong here ends neither the service nor another request."""
        if self._link.lockstep or (isinstance(event, Request) and event.query.name not in self._at_once):
            self._tick_if_due()  # in lockstep every step is answered, by what was known of it
        try:
            self.inbox.dispatch(event)
        except Exception as error:
            self.log_once(error)
            if isinstance(event, Request):
                event.refuse(RefusalCode.INTERNAL, f"the {self._service.service} failed to answer; see its log")
        self._core.publish()

    def log_once(self, error: Exception) -> None:
        """With its traceback; an error that comes back at every tick is written once."""
        text = f"{type(error).__name__}: {error}"
        if text != self._last_error:
            log.error(text, exc_info=error)
        self._last_error = text

    def _on_clock(self, _world: str, clock: Clock) -> None:
        self._lockstep.clock(clock.run)
        self._void_if(self._link.clock(clock, self._monotonic()))
        self._core.on_clock(clock)

    def _on_presence(self, service: ServiceId, alive: bool) -> None:
        self._lockstep.presence(service, alive)
        if service == ServiceId(DRIVER, self._robot):
            self._void_if(self._link.presence(alive, self._monotonic()))

    def _void_if(self, why: str | None) -> None:
        if why is not None:
            log.warning(why, robot=self._robot)
            self._stamp = self._answer = None
            self._core.reset(why)
        if self._link.fault != self._fault:
            self._fault = self._link.fault
            self._core.set_driver_fault(self._fault)

    def _tick_if_due(self) -> None:
        stamp, self._stamp = self._stamp, None
        if stamp is None:
            return
        due = self._link.due(stamp)
        if due == "tick":
            self._answer = self._tick()
        if due != "skip" and self._answer is not None:
            self._command.put(self._answer)

    def _tick(self) -> C | None:
        try:
            return self._core.tick(self._link.lockstep)
        except Exception as error:
            self.log_once(error)
            return self._core.tick_failed(error)
