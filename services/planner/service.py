"""The planner on the bus: one thread, one inbox. Requests are answered at once, commands go out with odometry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rackhand.bus import Bus, Event, Inbox, Presence, Refused, Request, Sample, Unavailable
from rackhand.bus.errors import CallTimeout
from rackhand.bus.log import get_logger
from rackhand.runtime.driver_link import DriverLink
from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.schemas.service import WORLD, ServiceId
from rackhand.schemas.topics import Query, Topic
from rackhand.schemas.world import Join, WorldRequest
from rackhand.services.planner.chassis import PERIOD_NS, Chassis

log = get_logger(__name__)

SIMULATOR = ServiceId("sim", WORLD)
SUBSCRIPTIONS = (
    topics.ODOMETRY,
    topics.SCAN,
    topics.POSE,
    topics.JACK,
    topics.BATTERY,
    topics.CONTACTS,
    topics.CHASSIS_MODEL,
)
PUBLICATIONS = (
    topics.PLANNING_STATE,
    topics.PATH,
    topics.MOVE_EVENT,
    topics.MAP,
    topics.CHASSIS_STATUS,
    topics.COSTMAP,
)
ANSWERED = (topics.MOVES, topics.MAPS, topics.CHASSIS_REQUEST)
READ_AHEAD = 64  # events taken in before a tick, so that it answers the newest odometry and yet is not put off for ever


class PlannerService:
    """Wires one chassis to the bus. ``run`` returns when the bus stops."""

    def __init__(self, bus: Bus, robot: str, chassis: Chassis) -> None:
        self._bus = bus
        self._robot = robot
        self._chassis = chassis
        self._link = DriverLink("the chassis' driver", PERIOD_NS)
        self._odometry_stamp: int | None = None
        self._answer: ChassisCommand | None = None
        self._last_error = ""
        self._answers: dict[Query[Any, Any], Callable[[Any], Message]] = {
            topics.MOVES: chassis.moves,
            topics.MAPS: chassis.maps,
            topics.CHASSIS_REQUEST: chassis.chassis,
        }
        self._command = bus.publisher(topics.COMMAND, robot)
        self._publishers = {topic: bus.publisher(topic, robot) for topic in PUBLICATIONS}
        self._inbox = self._subscribe()

    def _subscribe(self) -> Inbox:
        inbox = self._bus.inbox()
        for topic in SUBSCRIPTIONS:
            inbox.subscribe(topic, self._robot)
        inbox.subscribe(topics.CLOCK, WORLD)
        for query in ANSWERED:
            inbox.serve(query, self._robot)
        inbox.watch_services()
        return inbox

    def run(self) -> None:
        self._publish()
        self._bus.announce()
        log.info("ready", robot=self._robot)
        for event in self._inbox:
            self._take(event)
            for _ in range(READ_AHEAD):
                if (further := self._inbox.get(0)) is None:
                    break
                self._take(further)
            self._tick_if_due()
            self._join_if_needed()

    def _take(self, event: Event) -> None:
        if isinstance(event, Request) or self._link.lockstep:
            self._tick_if_due()  # what arrives after a step was measured does not change its answer
        self.handle(event)

    def handle(self, event: Event) -> None:
        """Take in one event. What goes wrong here ends neither the service nor another request."""
        try:
            match event:
                case Sample():
                    self._on_message(event.topic, event.message)
                case Request():
                    self._serve(event)
                case Presence(service=service, alive=alive) if service == SIMULATOR:
                    self._void_if(self._link.presence(alive))
        except Exception as error:
            self._log_once(error)
            if isinstance(event, Request):
                event.refuse(RefusalCode.INTERNAL, "the planner failed to answer; its log says more")
        self._publish()

    # -- what is heard -----------------------------------------------------------------------------------------------

    def _on_message(self, topic: Topic[Any], message: Any) -> None:
        if topic is topics.CLOCK:
            self._void_if(self._link.clock(message))
            self._chassis.on_clock(message)
            return
        if topic is not topics.CHASSIS_MODEL:  # which is latched, and belongs to no instant
            self._void_if(self._link.sample(topic.name, message.stamp))
        self._chassis.on_message(message)
        if topic is topics.ODOMETRY:
            self._odometry_stamp = message.stamp

    def _void_if(self, why: str | None) -> None:
        if why is not None:
            log.warning(why, robot=self._robot)
            self._odometry_stamp = self._answer = None
            self._chassis.reset(why)
        if self._link.alive != self._chassis.driver_alive:
            self._chassis.set_driver_alive(self._link.alive)

    def _serve(self, request: Request[Any, Any]) -> None:
        """What a request caused is told before it is answered: who acts on the answer finds it so."""
        try:
            reply = self._answers[request.query](request.message)
        except RequestRefused as refused:
            self._publish()
            request.refuse(refused.code, refused.text)
        else:
            self._publish()
            request.reply(reply)

    # -- what is told ------------------------------------------------------------------------------------------------

    def _tick_if_due(self) -> None:
        stamp, self._odometry_stamp = self._odometry_stamp, None
        if stamp is None:
            return
        asked = self._link.asks(stamp)
        if asked == "tick":
            self._answer = self._tick()
        if asked != "skip" and self._answer is not None:
            self._command.put(self._answer)
        self._publish()

    def _tick(self) -> ChassisCommand:
        try:
            return self._chassis.tick()
        except Exception as error:
            self._log_once(error)
            return self._chassis.fail_internally(error)

    def _publish(self) -> None:
        for publication in self._chassis.take_publications():
            if publication.topic is topics.MOVE_EVENT:
                self._log_event(publication.message)
            self._publishers[publication.topic].put(publication.message)

    def _log_event(self, event: Any) -> None:
        log.info(f"move {event.move_id} {event.event}", text=event.text)

    def _log_once(self, error: Exception) -> None:
        """With its traceback; an error that comes back at every tick is written once."""
        text = f"{type(error).__name__}: {error}"
        if text != self._last_error:
            log.error(text, exc_info=error)
        self._last_error = text

    # -- joining -----------------------------------------------------------------------------------------------------

    def _join_if_needed(self) -> None:
        """Ask the simulator to wait for this planner's commands, once it could answer. A real robot is not asked."""
        if not self._link.needs_join or not self._chassis.ready:
            return
        request = WorldRequest(request=Join(robot=self._robot, service="planner", period_ns=PERIOD_NS))
        try:
            self._bus.call(topics.WORLD_CONTROL, request, timeout=2.0)
        except Refused as refused:
            log.error("the simulator refused the planner", code=refused.code, text=refused.text)
        except (Unavailable, CallTimeout) as error:
            self._log_once(error)
            return  # it is announced and does not answer yet: its next message is the occasion to ask again
        self._link.needs_join = False
