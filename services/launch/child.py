"""One running process of the cell: started in its own process group, read line by line, ended for certain."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from rackhand.services.launch.output import copy_lines
from rackhand.services.launch.processes import Process

GUARD = Path(__file__).with_name("guard.py")
LAST_WORDS = 1.0  # seconds to read what an ended process has left in its pipe


class Child:
    """A started process. It leads its own process group, so Ctrl-C in a terminal reaches only the supervisor."""

    def __init__(self, process: asyncio.subprocess.Process, reading: asyncio.Task[None]) -> None:
        self._process = process
        self._reading = reading
        self._started = time.monotonic()
        self.pid = process.pid

    @classmethod
    async def start(cls, spec: Process, environment: Mapping[str, str], write: Callable[[str], None]) -> Child:
        # A pipe of our own: asyncio's would not report that the process ended while a child of it holds the other end.
        read_end, write_end = os.pipe()
        try:
            process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-I", "-S", str(GUARD), str(os.getpid()), *spec.argv),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=write_end,
                stderr=write_end,
                env={**environment, **spec.env, "PYTHONUNBUFFERED": "1", "RACKHAND_SUPERVISED": "1"},
                process_group=0,
            )
        except BaseException:
            os.close(read_end)
            raise
        finally:
            os.close(write_end)
        return cls(process, asyncio.create_task(_read(read_end, write)))

    async def wait(self) -> tuple[int, float]:
        """The exit code (negative for a signal) and for how many seconds it ran; its last lines are out by then."""
        code = await self._process.wait()
        ran_for = time.monotonic() - self._started
        self.signal(signal.SIGKILL)  # whatever it may have left in its group
        await asyncio.wait({self._reading}, timeout=LAST_WORDS)
        self._reading.cancel()
        return code, ran_for

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to its whole group; nothing happens if that is gone."""
        try:
            os.killpg(self.pid, number)
        except ProcessLookupError:
            pass
        except PermissionError:  # macOS says this of a group of zombies
            pass


async def _read(pipe: int, write: Callable[[str], None]) -> None:
    stream = asyncio.StreamReader()
    with os.fdopen(pipe, "rb") as file:
        transport, _ = await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(stream), file
        )
        try:
            await copy_lines(stream, write)
        finally:
            transport.close()


def describe_exit(code: int) -> str:
    """``exit code 3`` or ``SIGKILL``."""
    if code >= 0:
        return f"exit code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"
