"""The planner on the bus: its control loop runs the core of one chassis. Commands go out with odometry."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, TypeVar

from rackhand.bus import Bus, Request
from rackhand.bus.log import get_logger
from rackhand.runtime.control_loop import ControlLoop, LoopSettings
from rackhand.runtime.outbox import Outbox
from rackhand.runtime.store import Settled
from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.schemas.chassis import (
    ChassisCommand,
    ChassisRequest,
    ClearJackErrors,
    Done,
    JackRequest,
    JackSelfCheck,
)
from rackhand.schemas.maps import MapReply, MapRequest
from rackhand.schemas.moves import MoveEvent
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.schemas.service import ServiceId
from rackhand.schemas.topics import Qos, Query
from rackhand.schemas.world import Clock
from rackhand.services.planner.chassis import PERIOD_NS, Chassis
from rackhand.services.planner.map.line import MapLine
from rackhand.services.planner.map.service import Made
from rackhand.services.planner.store import PlannerStore

log = get_logger(__name__)

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

SUBSCRIPTIONS = topics.read_by("planner", owner="chassis")
PUBLICATIONS = tuple(topic for topic in topics.published_by("planner") if topic is not topics.COMMAND)


class PlannerService:
    """Gives the control loop the core of one chassis. ``run`` returns when the bus stops.

    Requests take effect at once, so that a run in lockstep does not depend on the disk. What is said of them, replies
    and publications, waits in an outbox until it is on disk: ``kill -9`` loses nothing that was said. A request whose
    change cannot be written is refused: a new move is failed (the one it replaced stays cancelled), maps are as before.
    """

    busy = False

    def __init__(
        self,
        bus: Bus,
        robot: str,
        chassis: Chassis,
        store: PlannerStore,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._chassis, self._store = chassis, store
        self._outbox = Outbox(lambda: store.submitted)
        settings = LoopSettings(ServiceId("planner", robot), "the chassis driver", PERIOD_NS)
        self._loop = ControlLoop(bus, self, topics.COMMAND, settings, monotonic)
        store.on_settled(self._loop.inbox.poster(self._settle))
        for topic in SUBSCRIPTIONS:
            if topic.qos is Qos.LATCHED:
                self._loop.on(topic, chassis.on_message)
            else:
                self._loop.measure(topic, chassis.on_message, triggers=topic is topics.ODOMETRY)
        self._serve(topics.MOVES, chassis.moves)
        self._serve(topics.EXPLAIN, chassis.explain)
        self._serve(topics.CHASSIS_PARAMETERS, chassis.parameters.answer)
        loading, poster = ThreadPoolExecutor(1, thread_name_prefix="map"), self._loop.inbox.poster
        self._maps = MapLine(chassis.map_work, self._answer_maps, loading, poster, monotonic)
        self._loop.on_request(topics.MAPS, self._maps.put)
        self._serve(topics.CHASSIS_REQUEST, self._answer_chassis)
        self._publishers: dict[str, Any] = {topic.name: bus.publisher(topic, robot) for topic in PUBLICATIONS}
        self.run = self._loop.run

    def _serve(self, query: Query[Q, R], answer: Callable[[Q], R]) -> None:
        """What a request caused is published before it is answered: a client that acts on the answer finds it so."""

        self._loop.on_request(query, lambda request: self._answer(request, answer))

    def _answer(self, request: Request[Q, R], answer: Callable[[Q], R]) -> None:
        since = self._store.submitted
        try:
            reply = answer(request.message)
        except RequestRefused as refused:
            code, text = refused.code, refused.text
            self.publish()
            self._outbox.put(lambda: request.refuse(code, text))
        else:
            self.publish()
            self._outbox.put(
                lambda: request.reply(reply),
                lambda why: request.refuse(RefusalCode.UNAVAILABLE, f"could not be stored: {why}"),
                since,
            )

    def _answer_maps(self, request: Request[MapRequest, MapReply], made: Callable[[], Made] | None) -> None:
        self._answer(request, lambda message: self._chassis.maps(message, None if made is None else made()))

    def _answer_chassis(self, request: ChassisRequest) -> Done:
        """Orders to the jack are logged, with what became of them."""
        order = request.request
        if not isinstance(order, JackRequest | JackSelfCheck | ClearJackErrors):
            return self._chassis.chassis(request)
        what = f"jack {order.direction}" if isinstance(order, JackRequest) else order.op.replace("_", " ")
        try:
            done = self._chassis.chassis(request)
        except RequestRefused as refused:
            log.warning(f"{what} refused", why=refused.text)
            raise
        log.info(f"{what} accepted", detail=done.detail)
        return done

    def _settle(self, settled: Settled) -> None:
        failed = self._store.settle(settled)
        if failed is not None:
            log.error("the store cannot be written", error=failed.why, store=self._store.path)
            self._chassis.store_failed(failed.move_id, failed.maps_undone, failed.why)
        self._outbox.settle(settled)

    # -- the loop's core ---------------------------------------------------------------------------------------------

    @property
    def ready(self) -> bool:
        return self._chassis.ready

    def on_clock(self, clock: Clock) -> None:
        self._chassis.on_clock(clock)

    def tick(self, lockstep: bool) -> ChassisCommand:
        return self._chassis.tick(lockstep)

    def tick_failed(self, error: Exception) -> ChassisCommand:
        return self._chassis.fail_internally(error)

    def reset(self, why: str) -> None:
        self._chassis.reset(why)

    def set_driver_fault(self, fault: str) -> None:
        self._chassis.set_driver_fault(fault)

    def poll(self) -> None:
        self._maps.check()

    def wait(self, seconds: float) -> None: ...

    def publish(self) -> None:
        for publication in self._chassis.take_publications():
            if isinstance(publication.message, MoveEvent):
                event = publication.message
                log.info(f"move {event.move_id} {event.event}", detail=event.text)
            self._outbox.put(partial(self._publishers[publication.topic.name].put, publication.message))
