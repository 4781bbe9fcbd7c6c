"""The application on a real loopback port, in a thread, fed by the test."""

from __future__ import annotations

import asyncio
import base64
import json
import socket
import struct
import threading
import zlib
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from typing import Any, cast

import httpx
import uvicorn
from fastapi import FastAPI
from websockets.sync.client import ClientConnection, connect

from rackhand.bus import Presence
from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.services.gateway.context import Context, Shared
from rackhand.services.gateway.fleet import Fleet
from rackhand.services.gateway.http.app import create_app
from rackhand.services.gateway.presence import Services
from rackhand.services.gateway.service import server_config
from rackhand.services.gateway.settings import Settings
from rackhand.services.gateway.ws.broadcast import Hub
from rackhand.services.gateway.ws.payloads import PAYLOADS
from tests.gateway.fake_bus import FakeBus

PATIENCE = 20.0  # seconds; only ever bounds a failure
STARTED = 1000.0
UNPACED = 1e9  # Hz: no frame waits for its rate


class Gateway:
    """A running gateway: its URL, its fake robot, and a client."""

    def __init__(self, port: int, app: FastAPI, loop: asyncio.AbstractEventLoop) -> None:
        self.url = f"http://127.0.0.1:{port}"
        self.port = port
        self.http = httpx.Client(base_url=self.url, timeout=PATIENCE, trust_env=False)
        self._app = app
        self._loop = loop

    @property
    def bus(self) -> FakeBus:
        return cast(FakeBus, self.shared.bus)

    @property
    def hub(self) -> Hub:
        return self.shared.fleet.hubs[self.shared.fleet.default]

    @property
    def shared(self) -> Shared:
        return cast(Shared, self._app.state.shared)

    @property
    def context(self) -> Context:
        return Context(self.shared, self.shared.fleet.default)

    def reset(self) -> None:
        """Forget everything that was received and asked; go on listening."""
        settings = self.shared.settings
        fleet = Fleet(settings.robots, settings.interval, Services(self.shared.fleet.services.expected, STARTED))
        self._app.state.shared = Shared(settings, fleet, FakeBus(), self.shared.motion)

    def presence(self, *changes: Presence) -> None:
        """Have liveliness tokens change; returns when that is taken in."""
        services = self.shared.fleet.services
        self.call(lambda: [services.on_presence(change.service, change.alive, STARTED) for change in changes])

    def publish(self, topic: topics.Topic[Any], message: Message, robot: str = "amr1") -> None:
        """Have a message arrive from the bus; returns when it is taken in."""
        self.call(lambda: self.shared.fleet.on_message(topic, robot, message))

    def call(self, function: Callable[[], Any]) -> Any:
        """Run something in the server's loop."""

        async def run() -> Any:
            return function()

        return self.run(run())

    def run(self, work: Coroutine[Any, Any, Any]) -> Any:
        """Run a coroutine in the server's loop."""
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(PATIENCE)

    @contextmanager
    def websocket(self, path: str = "/ws/v2/topics", **options: Any) -> Iterator[Socket]:
        url = f"ws://127.0.0.1:{self.port}{path}"
        # Without a bound on what it has not read, the client never stops reading, and closing never waits.
        with connect(url, open_timeout=PATIENCE, proxy=None, max_queue=None, **options) as connection:
            yield Socket(connection)


class Socket:
    """A WebSocket client that skips the server's unrequested frames about connections."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection

    def send(self, value: Any) -> None:
        self.connection.send(value if isinstance(value, str | bytes) else json.dumps(value))

    def receive(self) -> dict[str, Any]:
        while True:
            message: dict[str, Any] = json.loads(self.connection.recv(timeout=PATIENCE))
            if not message.get("topic", "").startswith("/ws_connection"):
                return message

    def ask(self, value: Any) -> dict[str, Any]:
        self.send(value)
        return self.receive()


def new_app(settings: Settings | None = None, expect: tuple[Any, ...] = ()) -> FastAPI:
    """The application over a fake robot, not served."""
    settings = settings or Settings()
    fleet = Fleet(settings.robots, settings.interval, Services(expect, STARTED))
    return create_app(fleet, FakeBus(), settings)


@contextmanager
def running_gateway(settings: Settings | None = None, expect: tuple[Any, ...] = ()) -> Iterator[Gateway]:
    settings = settings or Settings(rates=dict.fromkeys(PAYLOADS, UNPACED), planning_state_timeout=0)
    app = new_app(settings, expect)
    listener = socket.create_server(("127.0.0.1", 0))
    server = uvicorn.Server(server_config(app, settings))
    loop = asyncio.new_event_loop()
    started = threading.Event()

    async def serve() -> None:
        serving = asyncio.create_task(server.serve([listener]))
        while not server.started and not serving.done():
            await asyncio.sleep(0.01)
        started.set()
        await serving

    thread = threading.Thread(target=lambda: loop.run_until_complete(serve()), daemon=True)
    thread.start()
    try:
        assert started.wait(PATIENCE)
        gateway = Gateway(listener.getsockname()[1], app, loop)
        yield gateway
        gateway.http.close()
    finally:
        server.should_exit = True
        thread.join(PATIENCE)
        loop.close()
        assert not thread.is_alive()


def grey_png(width: int, height: int, value: int = 255) -> bytes:
    """An 8-bit grey PNG of one shade, not compressed: its size is that of its pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = (b"\0" + bytes([value]) * width) * height
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 0)) + chunk(b"IEND", b"")


def map_body(**changes: Any) -> dict[str, Any]:
    return {
        "map_name": "hall",
        "occupancy_grid": base64.b64encode(grey_png(4, 3)).decode(),
        "carto_map": "",
        "grid_origin_x": -1.0,
        "grid_origin_y": -2.0,
        "grid_resolution": 0.05,
        **changes,
    }
