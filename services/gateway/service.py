"""The gateway as a process: bus in, HTTP and WebSocket out."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import socket
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from functools import partial

import uvicorn
import uvloop

from rackhand.bus import Bus, Inbox
from rackhand.bus.log import configure_logging, get_logger
from rackhand.schemas import topics
from rackhand.schemas.motion import SessionGone
from rackhand.schemas.service import ServiceId
from rackhand.services.gateway.context import Context, Shared
from rackhand.services.gateway.crf.hub import MotionHub
from rackhand.services.gateway.crf.tcp import CrfPort
from rackhand.services.gateway.crf.text import MAX_FRAME
from rackhand.services.gateway.fleet import Fleet
from rackhand.services.gateway.http.app import create_app
from rackhand.services.gateway.presence import Services
from rackhand.services.gateway.settings import Settings

log = get_logger(__name__)

EVENTS_A_TURN = 32  # events of the bus handled before clients are served again
NAME_PATIENCE = 2.5  # seconds until the token of a gateway that was killed has surely expired


class Server(uvicorn.Server):
    """Calls ``on_listening`` when it accepts connections; leaves signals to the service."""

    def __init__(self, config: uvicorn.Config, on_listening: Callable[[], None]) -> None:
        super().__init__(config)
        self._on_listening = on_listening

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            self._on_listening()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def run(settings: Settings) -> None:
    """Serve until a signal. Raises ``SystemExit`` where a port is taken."""
    configure_logging("gateway")
    with (
        Bus(ServiceId("gateway", settings.name)) as bus,
        bus.inbox() as inbox,
        asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner,
    ):
        runner.run(_serve(settings, bus, inbox))


async def _serve(settings: Settings, bus: Bus, inbox: Inbox) -> None:
    services = Services(settings.expected_services(), time.time(), bus.service)
    fleet = Fleet(settings.robots, settings.interval, services)
    app = create_app(fleet, bus, settings)
    shared: Shared = app.state.shared
    fleet.subscribe(inbox)
    _connect_motion(shared.motion, bus, inbox)
    inbox.on_presence(lambda service, alive: services.on_presence(service, alive, time.time()))

    def listening() -> None:
        bus.announce()
        url = f"http://{settings.host}:{settings.port}"
        log.info("listening", name=settings.name, url=url, robots=settings.robots, arms=settings.arms)

    server = Server(server_config(app, settings), listening)
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, setattr, server, "should_exit", True)
    reading = asyncio.create_task(_read(inbox))
    # Without its reader the gateway would show old values as present ones: it ends, and the supervisor restarts it.
    reading.add_done_callback(lambda _: setattr(server, "should_exit", True))
    try:
        await _check_name(services)
        async with _crf_ports(shared):
            await server.serve()
    finally:
        inbox.stop()
        await reading
        fleet.close()


def _connect_motion(motion: MotionHub, bus: Bus, inbox: Inbox) -> None:
    """Events and streams of the arms in, closed connections out."""
    ended = {arm: bus.publisher(topics.MOTION_SESSION, arm) for arm in motion.arms}
    motion.gone = lambda arm, session: ended[arm].put(SessionGone(session=session))
    for arm in motion.arms:
        inbox.on(topics.MOTION_STREAM, motion.on_stream, arm)
        inbox.on(topics.MOTION_EVENT, motion.on_event, arm)


async def _check_name(services: Services) -> None:
    """Two gateways must not share a liveliness token: one that dies would seem alive. Raises ``SystemExit``."""
    await asyncio.sleep(0.2)  # the tokens that are there arrive at once
    waited = 0.0
    while services.is_alive(services.this) and waited < NAME_PATIENCE:
        await asyncio.sleep(0.1)
        waited += 0.1
    if services.is_alive(services.this):
        log.error(
            "a gateway with this name is already on the bus; choose another name with --name", name=str(services.this)
        )
        raise SystemExit(1)


@asynccontextmanager
async def _crf_ports(shared: Shared) -> AsyncIterator[None]:
    """The arms' TCP ports while the gateway serves. Raises ``SystemExit`` where one is taken."""
    opened: list[CrfPort] = []
    try:
        for arm, number in shared.settings.crf_ports.items():
            port = CrfPort(arm, shared.motion, partial(Context(shared, "").ask_arm, arm=arm))
            opened.append(port)
            host = shared.settings.host
            try:
                number = await port.start(host, number)
            except OSError as error:
                log.error("the CRF port cannot be opened", arm=arm, host=host, port=number, error=str(error))
                raise SystemExit(1) from None
            log.info("listening for CRF clients", arm=arm, host=host, port=number)
        yield
    finally:
        for port in opened:
            await port.close()


async def _read(inbox: Inbox) -> None:
    count = 0
    async for event in inbox.stream():
        inbox.dispatch(event)
        count += 1
        if count % EVENTS_A_TURN == 0:
            await asyncio.sleep(0)


def server_config(app: object, settings: Settings) -> uvicorn.Config:
    return uvicorn.Config(
        app,  # type: ignore[arg-type]
        host=settings.host,
        port=settings.port,
        log_config=None,
        access_log=False,
        log_level="warning",
        ws="websockets-sansio",
        ws_max_size=MAX_FRAME,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=2,
        server_header=False,
    )
