"""CRF's packet framing on TCP (spec motion-controller §1.1): an encoder and an incremental decoder.

A packet is six ``~``, a little-endian header (type u16, payload length u32, timestamp i64, writer u8, checksum u8)
and the payload. Nothing of ours is imported, so that any process with a socket can use it.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

SYNC = b"~~~~~~"
JSON_PACKET = 801
MAX_PAYLOAD = 16 * 1024 * 1024

_HEADER = struct.Struct("<HIqBB")
_TILDES = re.compile(SYNC + b"+")


@dataclass(frozen=True)
class Packet:
    """``timestamp`` is 0 if unset; a server writes the ``writer`` of the last packet it read."""

    payload: bytes
    type: int = JSON_PACKET
    timestamp: int = 0
    writer: int = 0


def checksum(type_: int, length: int, timestamp: int, writer: int) -> int:
    """The sum of the header's fields mod 255. The sign follows C, where the sum of a negative timestamp is negative."""
    total = type_ + length + timestamp + writer
    return (abs(total) % 255 * (1 if total >= 0 else -1)) & 0xFF


def encode(packet: Packet) -> bytes:
    """Raises ``ValueError`` for a payload over ``MAX_PAYLOAD`` or header fields out of range."""
    length = len(packet.payload)
    if length > MAX_PAYLOAD:
        raise ValueError(f"payload of {length} bytes, at most {MAX_PAYLOAD}")
    head = (packet.type, length, packet.timestamp, packet.writer)
    try:
        return SYNC + _HEADER.pack(*head, checksum(*head)) + packet.payload
    except struct.error as error:
        raise ValueError(f"header {head} does not fit: {error}") from None


class Decoder:
    """Takes bytes in pieces of any size and gives the packets they complete.

    Bytes that are no packet are skipped, and counted in ``skipped``: after a header with a wrong checksum the search
    continues at the byte after its first ``~``, so that a packet hidden in garbage is still found. A valid header of
    more than ``max_payload`` bytes ends the decoding: its length is in ``too_large``, and further bytes are ignored.
    """

    def __init__(self, max_payload: int = MAX_PAYLOAD) -> None:
        self.skipped = 0
        self.too_large = 0
        self._max_payload = max_payload
        self._buffer = bytearray()
        self._wanted = 0

    def feed(self, data: bytes) -> list[Packet]:
        packets: list[Packet] = []
        if self.too_large:
            return packets
        self._buffer += data
        # A large payload arrives in pieces; nothing can be decoded before the last of them.
        if len(self._buffer) < self._wanted:
            return packets
        position = 0
        while (found := self._next(position)) is not None:
            packet, position = found
            if packet is not None:
                packets.append(packet)
        return packets

    def _next(self, position: int) -> tuple[Packet | None, int] | None:
        """A packet (or none) and where to continue; ``None`` when more bytes are needed. Drops bytes that are used."""
        buffer = self._buffer
        run = _TILDES.search(buffer, position)
        if run is None:
            tail = len(buffer) - _partial_sync(buffer, position)
            self._drop(tail, tail - position)
            return None
        # Of a longer run of tildes the last six are the marker: no packet type begins with one.
        start = run.end() - len(SYNC)
        head_end = run.end() + _HEADER.size
        if len(buffer) < head_end:
            self._drop(start, start - position)
            self._wanted = head_end - start
            return None
        type_, length, timestamp, writer, check = _HEADER.unpack_from(buffer, start + len(SYNC))
        if check != checksum(type_, length, timestamp, writer):
            self.skipped += start + 1 - position
            return None, start + 1
        if length > self._max_payload:
            self.too_large = length
            self._drop(len(buffer), start - position)
            return None
        if len(buffer) < head_end + length:
            self._drop(start, start - position)
            self._wanted = head_end + length - start
            return None
        self.skipped += start - position
        packet = Packet(bytes(buffer[head_end : head_end + length]), type_, timestamp, writer)
        return packet, head_end + length

    def _drop(self, end: int, skipped: int) -> None:
        self.skipped += skipped
        self._wanted = 0
        del self._buffer[:end]


def _partial_sync(buffer: bytearray, position: int) -> int:
    """How many ``~`` the buffer ends with: the beginning of a marker, perhaps."""
    count = 0
    while count < len(SYNC) - 1 and len(buffer) - count > position and buffer[-1 - count] == SYNC[0]:
        count += 1
    return count
