"""A round trip of bytes over bare Zenoh to another process, at a driver's pace.

python -m benchmarks.motion.bare ENDPOINT SIZE      is that other process
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from types import TracebackType

import zenoh

from rackhand.bus import BusConfig

PING, PONG = "rackhand/bench/motion/ping", "rackhand/bench/motion/pong"
PATIENCE = 20.0  # s for the other process, in addition to what is measured
SETTINGS = {"express": True, "congestion_control": zenoh.CongestionControl.BLOCK}


class BareEcho:
    """Bytes of one size out, of another size back. ``times`` [s] of all round trips."""

    def __init__(self, config: BusConfig, out: int, back: int) -> None:
        self._config, self._payload, self._back = config, bytes(out), back
        self.times: list[float] = []
        self._stack = ExitStack()

    def __enter__(self) -> BareEcho:
        argv = [sys.executable, "-m", "benchmarks.motion.echo", self._config.connect, str(self._back)]
        self._echo = subprocess.Popen(argv)
        try:
            self._connect()
        except BaseException:
            self._end()
            raise
        return self

    def _connect(self) -> None:
        session = self._stack.enter_context(zenoh.open(self._config.zenoh_config()))
        self._pongs = session.declare_subscriber(PONG, zenoh.handlers.FifoChannel(16))
        self._pings = session.declare_publisher(PING, **SETTINGS)
        self._give_up = session.declare_publisher(PONG, **SETTINGS)
        deadline = time.monotonic() + PATIENCE
        while self._pings.matching_status.matching is False:
            if time.monotonic() > deadline:
                raise TimeoutError(f"bare echo: not there after {PATIENCE:g} s; {self._process()}")
            time.sleep(0.05)
        self.ping_for(0.5, 0.002)
        self.times.clear()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def _end(self) -> None:
        self._echo.terminate()
        self._stack.close()
        self._echo.wait(10)

    def ping_for(self, seconds: float, period: float) -> None:
        """One round trip a period, by the absolute clock."""
        # The handler waits for ever; an empty payload ends that.
        bound = threading.Timer(seconds + PATIENCE, self._give_up.put, [b""])
        bound.daemon = True
        bound.start()
        try:
            self._ping_for(seconds, period)
        finally:
            bound.cancel()

    def _ping_for(self, seconds: float, period: float) -> None:
        begun = time.perf_counter()
        for i in range(round(seconds / period)):
            time.sleep(max(0.0, begun + i * period - time.perf_counter()))
            sent = time.perf_counter()
            self._pings.put(self._payload)
            if not self._pongs.recv().payload.to_bytes():
                raise TimeoutError(
                    f"bare echo: {i} of {round(seconds / period)} round trips in {seconds + PATIENCE:g} s; "
                    f"{self._process()}"
                )
            self.times.append(time.perf_counter() - sent)

    def _process(self) -> str:
        code = self._echo.poll()
        return "its process runs" if code is None else f"its process has ended with code {code}"
