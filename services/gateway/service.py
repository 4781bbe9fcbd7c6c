"""The gateway as a process: bus in, HTTP and WebSocket out."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import socket
import time
from collections.abc import Callable, Iterator
from functools import partial

import uvicorn
import uvloop

from rackhand.bus import Bus, Inbox
from rackhand.bus.log import configure_logging, get_logger
from rackhand.schemas import topics
from rackhand.schemas.motion import SessionGone
from rackhand.schemas.service import CELL, ServiceId
from rackhand.services.gateway.context import Context
from rackhand.services.gateway.crf import hub as motion_hub
from rackhand.services.gateway.crf.hub import MotionHub
from rackhand.services.gateway.crf.tcp import CrfPort
from rackhand.services.gateway.crf.text import MAX_FRAME
from rackhand.services.gateway.http.app import create_app
from rackhand.services.gateway.settings import Settings
from rackhand.services.gateway.state import SUBSCRIPTIONS, State
from rackhand.services.gateway.ws.broadcast import Hub

log = get_logger(__name__)

EVENTS_A_TURN = 32  # of the bus, after which clients get theirs


class Server(uvicorn.Server):
    """Tells when it listens; leaves signals to the service."""

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
        Bus(ServiceId("gateway", CELL)) as bus,
        bus.inbox() as inbox,
        asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner,
    ):
        runner.run(_serve(settings, bus, inbox))


async def _serve(settings: Settings, bus: Bus, inbox: Inbox) -> None:
    state = State(settings.robot, settings.expected_services(), time.time())
    app = create_app(state, bus, settings)
    for topic, depth in SUBSCRIPTIONS.items() if settings.robot else ():
        inbox.subscribe(topic, settings.robot, depth)
    motion: MotionHub = app.state.context.motion
    ended = {arm: bus.publisher(topics.MOTION_SESSION, arm) for arm in motion.arms}
    motion.gone = lambda arm, session: ended[arm].put(SessionGone(session=session))
    for arm in motion.arms:
        for told in motion_hub.SUBSCRIPTIONS:
            inbox.subscribe(told, arm)
    inbox.watch_services()

    def listening() -> None:
        bus.announce()
        log.info("listening", url=f"http://{settings.host}:{settings.port}", robot=settings.robot)

    server = Server(server_config(app, settings), listening)
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, setattr, server, "should_exit", True)
    crf = await _open_crf_ports(app.state.context)
    hub: Hub = app.state.context.hub
    hearing = asyncio.create_task(_on_message(inbox, hub, motion))
    # Deaf, the gateway would show stale things as present: it ends, and is started anew.
    hearing.add_done_callback(lambda _: setattr(server, "should_exit", True))
    try:
        await server.serve()
    finally:
        for port in crf:
            await port.close()
        inbox.stop()
        await hearing
        hub.close()


async def _open_crf_ports(context: Context) -> list[CrfPort]:
    opened: list[CrfPort] = []
    for arm, number in context.settings.crf_ports.items():
        port = CrfPort(arm, context.motion, partial(context.ask_arm, arm=arm))
        host = context.settings.host
        try:
            number = await port.start(host, number)
        except OSError as error:
            log.error("the CRF port cannot be opened", arm=arm, host=host, port=number, error=str(error))
            raise SystemExit(1) from None
        log.info("CRF clients may connect", arm=arm, host=host, port=number)
        opened.append(port)
    return opened


async def _on_message(inbox: Inbox, hub: Hub, motion: MotionHub) -> None:
    count = 0
    async for event in inbox.stream():
        hub.on_message(event)
        motion.on_message(event)
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
