"""Which TCP ports are free."""

from __future__ import annotations

import random
import socket
from dataclasses import replace

from services.launch.processes import Address

# Below what Linux hands out itself: a service that listens anywhere, or connects, may take one that is not in use yet.
QUIET = range(20_000, 32_768)


def in_the_way(address: Address) -> str:
    """Why nobody can listen there; empty if one can."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address.host, address.port))
        except OSError as error:
            return error.strerror or str(error)
    return ""


def with_port(address: Address) -> Address:
    """Port 0 is any free one."""
    if address.port:
        return address
    free = (replace(address, port=port) for port in random.sample(QUIET, len(QUIET)))
    return next((found for found in free if not in_the_way(found)), address)
