"""``python -m bus.router``: the meeting point of a cell's services, and the door for everyone else.

Peers that found each other through it talk directly: it may die and come back without their noticing.
"""

from __future__ import annotations

import argparse
import signal

import zenoh

from bus.config import DEFAULT_ROUTER, BusConfig
from bus.log import configure_logging, get_logger
from schemas.service import CELL, ServiceId


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bus.router",
        description=__doc__,
        epilog="example: python -m bus.router --listen tcp/127.0.0.1:7447",
    )
    parser.add_argument("--listen", default=DEFAULT_ROUTER, help="Zenoh end points, comma-separated (%(default)s)")
    parser.add_argument("--connect", default="", help="other routers to join, comma-separated")
    arguments = parser.parse_args()
    configure_logging("router")
    # An environment made for the services names this very router: only the command line counts here.
    settings = BusConfig(mode="router", listen=arguments.listen, connect=arguments.connect)
    signals = {signal.SIGTERM, signal.SIGINT}
    signal.pthread_sigmask(signal.SIG_BLOCK, signals)  # before Zenoh's threads start, which inherit the mask
    with zenoh.open(settings.zenoh_config()) as session:
        token = session.liveliness().declare_token(ServiceId("router", CELL).key)
        get_logger(__name__).info("the bus is open", listen=arguments.listen)
        signal.sigwait(signals)
        token.undeclare()  # type: ignore[no-untyped-call]


if __name__ == "__main__":
    main()
