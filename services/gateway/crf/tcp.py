"""CRF's packet framing on TCP (spec motion-controller §1.1): one port an arm, one session a connection.

A connection is the client: when it ends, even by half, what the client held is let go. What is no packet is skipped
without an answer, as CRF does: nobody can tell who asked for what in it. A packet too long to be read is answered and
ends the connection.
"""

from __future__ import annotations

import asyncio
import socket
from asyncio import StreamReader, StreamWriter
from contextlib import suppress

from rackhand.bus.log import get_logger
from rackhand.schemas.crf_framing import JSON_PACKET, Decoder, Packet, encode
from rackhand.services.gateway.crf.hub import MotionHub
from rackhand.services.gateway.crf.session import Ask, Session
from rackhand.services.gateway.crf.text import MAX_FRAME, NOT_JSON, error_text

log = get_logger(__name__)

READ = 64 * 1024
LINGER = 1.0  # seconds in which a client may read the last that it is told


class CrfPort:
    """Listens for CRF clients of one arm, from ``start`` to ``close``."""

    def __init__(self, arm: str, motion: MotionHub, ask: Ask) -> None:
        self.arm = arm
        self._motion = motion
        self._ask = ask
        self._server: asyncio.Server | None = None
        self._connections: set[asyncio.Task[None]] = set()

    async def start(self, host: str, port: int) -> int:
        """Returns the port, which is a free one where 0 is asked for. Raises ``OSError`` where it is taken."""
        self._server = await asyncio.start_server(self._accept, host, port, limit=READ)
        return int(self._server.sockets[0].getsockname()[1])

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
        for task in self._connections:
            task.cancel()
        await asyncio.gather(*self._connections, return_exceptions=True)

    def _accept(self, reader: StreamReader, writer: StreamWriter) -> None:
        task = asyncio.get_running_loop().create_task(self._serve(Wire(reader, writer)))
        self._connections.add(task)
        task.add_done_callback(self._ended)

    async def _serve(self, wire: Wire) -> None:
        try:
            async with self._motion.session(self.arm, self._ask) as session:
                await session.serve(wire.receive(session), wire.send)
            if wire.too_large:
                await wire.part(error_text(NOT_JSON, f"{wire.too_large} bytes, at most {MAX_FRAME}"))
        finally:
            await wire.close()

    def _ended(self, task: asyncio.Task[None]) -> None:
        self._connections.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            log.error("internal error in a CRF connection", arm=self.arm, exc_info=error)


class Wire:
    """Packets of one connection."""

    def __init__(self, reader: StreamReader, writer: StreamWriter) -> None:
        self._reader, self._writer = reader, writer
        self._decoder = Decoder(MAX_FRAME)
        self._writer_id = 0  # of the last packet read
        connection: socket.socket = writer.get_extra_info("socket")
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)

    @property
    def too_large(self) -> int:
        """The bytes that a packet was to have which ended the reading; 0, none was too large."""
        return self._decoder.too_large

    async def receive(self, session: Session) -> None:
        """Hands requests to the session until the client ends, or sends what is too large."""
        while not self.too_large and (data := await self._read()):
            for packet in self._decoder.feed(data):
                self._writer_id = packet.writer
                if packet.type == JSON_PACKET:
                    session.take(packet.payload)
                else:
                    session.answer(error_text("Not supported packet type", f"{packet.type}, want {JSON_PACKET}"))
                await asyncio.sleep(0)  # a flood leaves others their turn

    async def send(self, text: str) -> None:
        """Raises ``ConnectionError`` when the client is gone."""
        if self._writer.is_closing():  # uvloop's transports take nothing then, and raise a RuntimeError
            raise ConnectionResetError
        try:
            self._writer.write(encode(Packet(text.encode(), writer=self._writer_id)))
            await self._writer.drain()
        except OSError as error:
            raise ConnectionResetError from error

    async def part(self, text: str) -> None:
        """The last word. What the client still sends is read away for a while: closing on it would take this back."""
        with suppress(OSError, TimeoutError):
            async with asyncio.timeout(LINGER):
                await self.send(text)
                self._writer.write_eof()
                while await self._read():
                    pass

    async def close(self) -> None:
        """What is written goes out if the client reads on; one that does not is cut off."""
        if self._decoder.skipped:
            log.info("invalid bytes from a CRF client skipped", skipped=self._decoder.skipped)
        self._writer.close()
        try:
            async with asyncio.timeout(LINGER):
                await self._writer.wait_closed()
        except (OSError, TimeoutError):
            self._writer.transport.abort()

    async def _read(self) -> bytes:
        """Empty when the client has ended, one way or another."""
        with suppress(OSError):
            return await self._reader.read(READ)
        return b""
