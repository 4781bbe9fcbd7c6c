"""Lines of the cell's processes, one under the other: ``HH:MM:SS service  text``."""

from __future__ import annotations

import asyncio
import codecs
import os
import shutil
import sys
from collections.abc import Callable
from datetime import datetime

LONGEST_LINE = 4096


ERASE_LINE = "\r\x1b[K"


class Output:
    """Writes lines to standard output, at once. ``on_closed`` is called when nobody reads it any more.

    In a terminal, a status is kept as the last line.
    """

    def __init__(self, names: list[str]) -> None:
        self._width = max(map(len, names))
        self.on_closed: Callable[[], None] = lambda: None
        self._closed = False
        self._status = ""

    def line(self, name: str, text: str) -> None:
        line = f"{datetime.now():%H:%M:%S} {name:<{self._width}}  {text}\n"
        self._write(f"{ERASE_LINE}{line}{self._status}" if self._status else line)

    def status(self, text: str) -> None:
        """Show this below the lines, cut to the terminal's width; nothing if empty or not in a terminal."""
        if not sys.stdout.isatty():
            return
        self._status = text[: shutil.get_terminal_size().columns - 1]
        self._write(f"{ERASE_LINE}{self._status}")

    def _write(self, text: str) -> None:
        if self._closed:
            return
        try:
            print(text, end="", flush=True)
        except (BrokenPipeError, OSError):
            self._closed = True
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains once more at its end
            self.on_closed()


async def copy_lines(stream: asyncio.StreamReader, write: Callable[[str], None]) -> None:
    """Hand each line of ``stream`` to ``write`` until it ends; bytes that are not UTF-8 are shown as such.

    A line longer than ``LONGEST_LINE`` is cut into several: a child that never ends a line is still printed.
    """
    decoder = codecs.getincrementaldecoder("utf-8")("backslashreplace")
    rest = ""
    while chunk := await stream.read(65536):
        *lines, rest = (rest + decoder.decode(chunk)).split("\n")
        for line in lines:
            _write_pieces(line, write)
        while len(rest) > LONGEST_LINE:
            write(rest[:LONGEST_LINE])
            rest = rest[LONGEST_LINE:]
    if rest:
        write(rest)


def _write_pieces(line: str, write: Callable[[str], None]) -> None:
    line = line.rstrip("\r")
    for start in range(0, max(len(line), 1), LONGEST_LINE):
        write(line[start : start + LONGEST_LINE])
