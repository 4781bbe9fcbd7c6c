"""``python -m benchmarks.motion.echo ENDPOINT SIZE``: answers each of ``bare``'s pings with so many bytes."""

from __future__ import annotations

import sys

import zenoh

from benchmarks.motion.bare import PING, PONG, SETTINGS
from rackhand.bus import BusConfig


def echo(endpoint: str, size: int) -> None:
    payload = bytes(size)
    with zenoh.open(BusConfig(connect=endpoint).zenoh_config()) as session:
        pings = session.declare_subscriber(PING, zenoh.handlers.FifoChannel(16))
        pong = session.declare_publisher(PONG, **SETTINGS)
        for sample in pings:
            sample.payload.to_bytes()
            pong.put(payload)


if __name__ == "__main__":
    echo(sys.argv[1], int(sys.argv[2]))
