"""``/static-files``: images that WebSocket frames name by their URL, by the hash of what they hold."""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

FOLDER = "static-files"
KEPT = 16


class Files:
    """The newest files of one robot. A name always has the same content, so clients may cache it."""

    def __init__(self, kept: int = KEPT) -> None:
        self._kept = kept
        self._files: OrderedDict[str, bytes] = OrderedDict()

    def put(self, kind: str, png: bytes) -> str:
        """Keep a PNG; the oldest file goes when there are too many. Returns its URL, relative to the API's root."""
        name = f"{kind}-{hashlib.sha256(png).hexdigest()}.png"
        self._files[name] = png
        self._files.move_to_end(name)
        while len(self._files) > self._kept:
            self._files.popitem(last=False)
        return f"{FOLDER}/{name}"

    def get(self, name: str) -> bytes | None:
        return self._files.get(name)


def grey_png(pixels: NDArray[np.uint8]) -> bytes:
    """An 8-bit grey PNG of rows of pixels, the first row on top."""
    rows, columns = pixels.shape
    lines = np.zeros((rows, columns + 1), np.uint8)  # a filter type before each row
    lines[:, 1:] = pixels
    header = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    body = _chunk(b"IHDR", header) + _chunk(b"IDAT", zlib.compress(lines.tobytes(), 1)) + _chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_size(png: bytes) -> tuple[int, int]:
    """Width and height from a PNG's header."""
    return int.from_bytes(png[16:20], "big"), int.from_bytes(png[20:24], "big")
