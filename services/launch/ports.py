"""Which TCP ports are free."""

from __future__ import annotations

import random
import socket
from dataclasses import replace

from rackhand.services.launch.processes import Address

# Below what Linux hands out itself: a service that listens anywhere, or connects, may take one that is not in use yet.
QUIET = range(20_000, 32_768)
TRIES = 100


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
    """Port 0 is any free one. Raises ``OSError`` where nobody can listen on that host."""
    if address.port:
        return address
    with socket.socket() as probe:
        probe.bind((address.host, 0))
        handed_out = replace(address, port=probe.getsockname()[1])
    quiet = (replace(address, port=port) for port in random.sample(QUIET, TRIES))
    return next((found for found in quiet if not in_the_way(found)), handed_out)
