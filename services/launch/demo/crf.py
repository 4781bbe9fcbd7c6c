"""A CRF client as a control engineer writes one: a blocking socket and the packet framing."""

from __future__ import annotations

import json
import socket
from collections import deque
from types import TracebackType
from typing import Any

from rackhand.schemas.crf_framing import Decoder, Packet, encode

PATIENCE = 20.0  # seconds; only ever bounds a failure


class CrfClient:
    """Texts and objects out, answers and events in. ``packet`` is the last one received."""

    def __init__(self, host: str, port: int, writer: int = 0) -> None:
        self.socket = socket.create_connection((host, port), timeout=PATIENCE)
        self.writer = writer
        self.packet = Packet(b"")
        self._decoder = Decoder()
        self._received: deque[Packet] = deque()

    def __enter__(self) -> CrfClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.socket.close()

    def frame(self, value: Any) -> bytes:
        """The packet of bytes, of a text, or of an object as JSON."""
        text = value if isinstance(value, bytes) else (value if isinstance(value, str) else json.dumps(value)).encode()
        return encode(Packet(text, writer=self.writer))

    def send(self, *values: Any) -> None:
        self.socket.sendall(b"".join(map(self.frame, values)))

    def receive(self) -> dict[str, Any]:
        """The next answer or event. Raises ``EOFError`` when the server has ended."""
        while not self._received:
            data = self.socket.recv(65536)
            if not data:
                raise EOFError
            self._received += self._decoder.feed(data)
        self.packet = self._received.popleft()
        read: dict[str, Any] = json.loads(self.packet.payload)
        return read

    def ask(self, value: Any) -> dict[str, Any]:
        """Send, and return what comes next, which is the answer where no events are sent."""
        self.send(value)
        return self.receive()
