"""The planner on the bus: its control loop runs the core of one chassis. Commands go out with odometry."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

from rackhand.bus import Bus, Request
from rackhand.bus.log import get_logger
from rackhand.runtime.control_loop import ControlLoop, LoopSettings
from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.moves import MoveEvent
from rackhand.schemas.refusal import RequestRefused
from rackhand.schemas.service import ServiceId
from rackhand.schemas.topics import Query
from rackhand.schemas.world import Clock
from rackhand.services.planner.chassis import PERIOD_NS, Chassis

log = get_logger(__name__)

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

MEASUREMENTS = (topics.ODOMETRY, topics.SCAN, topics.POSE, topics.JACK, topics.BATTERY, topics.CONTACTS)
PUBLICATIONS = (
    topics.PLANNING_STATE,
    topics.PATH,
    topics.MOVE_EVENT,
    topics.MAP,
    topics.CHASSIS_STATUS,
    topics.COSTMAP,
)


class PlannerService:
    """Gives the control loop the core of one chassis. ``run`` returns when the bus stops."""

    busy = False

    def __init__(self, bus: Bus, robot: str, chassis: Chassis, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._chassis = chassis
        settings = LoopSettings(ServiceId("planner", robot), "the chassis driver", PERIOD_NS)
        self._loop = ControlLoop(bus, self, topics.COMMAND, settings, monotonic)
        for topic in MEASUREMENTS:
            self._loop.measure(topic, chassis.on_message, triggers=topic is topics.ODOMETRY)
        self._loop.on(topics.CHASSIS_MODEL, chassis.on_message)
        self._serve(topics.MOVES, chassis.moves)
        self._serve(topics.MAPS, chassis.maps)
        self._serve(topics.CHASSIS_REQUEST, chassis.chassis)
        self._publishers: dict[str, Any] = {topic.name: bus.publisher(topic, robot) for topic in PUBLICATIONS}
        self.run = self._loop.run

    def _serve(self, query: Query[Q, R], answer: Callable[[Q], R]) -> None:
        """What a request caused is published before it is answered: a client that acts on the answer finds it so."""

        def serve(request: Request[Q, R]) -> None:
            try:
                reply = answer(request.message)
            except RequestRefused as refused:
                self.publish()
                request.refuse(refused.code, refused.text)
            else:
                self.publish()
                request.reply(reply)

        self._loop.on_request(query, serve)

    # -- the loop's core ---------------------------------------------------------------------------------------------

    @property
    def ready(self) -> bool:
        return self._chassis.ready

    def on_clock(self, clock: Clock) -> None:
        self._chassis.on_clock(clock)

    def tick(self, lockstep: bool) -> ChassisCommand:  # noqa: ARG002 - nothing is planned beside the tick
        return self._chassis.tick()

    def tick_failed(self, error: Exception) -> ChassisCommand:
        return self._chassis.fail_internally(error)

    def reset(self, why: str) -> None:
        self._chassis.reset(why)

    def set_driver_fault(self, fault: str) -> None:
        self._chassis.set_driver_fault(fault)

    def poll(self) -> None: ...

    def wait(self, seconds: float) -> None: ...

    def publish(self) -> None:
        for publication in self._chassis.take_publications():
            if isinstance(publication.message, MoveEvent):
                event = publication.message
                log.info(f"move {event.move_id} {event.event}", text=event.text)
            self._publishers[publication.topic.name].put(publication.message)
