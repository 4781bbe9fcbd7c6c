"""``python -m rackhand.bus.health world/sim``: exit status 0 if that service is on the bus, 1 if not."""

from __future__ import annotations

import argparse
import json
import os
import sys

import zenoh

from rackhand.bus.config import DEFAULT_ROUTER
from rackhand.schemas.service import ServiceId


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m rackhand.bus.health",
        description=__doc__,
        epilog="example: python -m rackhand.bus.health amr1/planner",
    )
    parser.add_argument("service", help="ROBOT/SERVICE, as in world/sim, amr1/planner, cell/gateway")
    robot, _, service = parser.parse_args().service.partition("/")
    sys.exit(0 if is_alive(ServiceId(service, robot)) else 1)


def is_alive(service: ServiceId, timeout: float = 1.0) -> bool:
    """Ask the router for the service's liveliness token."""
    config = {
        "mode": "client",
        "connect": {"endpoints": os.environ.get("RACKHAND_BUS_CONNECT", DEFAULT_ROUTER).split(",")},
        "scouting": {"multicast": {"enabled": False}},
    }
    try:
        with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
            return any(reply.ok is not None for reply in session.liveliness().get(service.key, timeout=timeout))
    except zenoh.ZError:
        return False


if __name__ == "__main__":
    main()
