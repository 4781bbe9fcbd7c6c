"""``python -m rackhand.bus.router``: where the services of a cell find each other, and where clients connect.

Peers that have found each other through it communicate directly, so it may be restarted while they run.
"""

from __future__ import annotations

import argparse
import asyncio
import signal

import zenoh

from rackhand.bus.config import DEFAULT_ROUTER, BusConfig
from rackhand.bus.log import configure_logging, get_logger
from rackhand.schemas.service import CELL, ServiceId


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m rackhand.bus.router",
        description=__doc__,
        epilog="example: python -m rackhand.bus.router --listen tcp/127.0.0.1:7447",
    )
    parser.add_argument("--listen", default=DEFAULT_ROUTER, help="Zenoh endpoints, comma-separated (%(default)s)")
    parser.add_argument("--connect", default="", help="other routers to join, comma-separated")
    arguments = parser.parse_args()
    configure_logging("router")
    # The environment of the services names this router itself: only the command line counts here.
    asyncio.run(route(BusConfig(mode="router", listen=arguments.listen, connect=arguments.connect)))


async def route(settings: BusConfig) -> None:
    """Run until SIGTERM or SIGINT. Handlers are installed before the router announces itself."""
    stopped = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, stopped.set)
    with zenoh.open(settings.zenoh_config()) as session:
        token = session.liveliness().declare_token(ServiceId("router", CELL).key)
        get_logger(__name__).info("listening", listen=settings.listen)
        await stopped.wait()
        token.undeclare()  # type: ignore[no-untyped-call]


if __name__ == "__main__":
    main()
