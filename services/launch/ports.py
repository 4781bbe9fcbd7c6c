"""Which TCP ports are free."""

from __future__ import annotations

import socket
from dataclasses import replace

from services.launch.processes import Address


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
    with socket.socket() as probe:
        probe.bind((address.host, 0))
        return replace(address, port=probe.getsockname()[1])
