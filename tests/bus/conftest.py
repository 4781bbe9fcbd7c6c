"""A bus of the test's own, on loopback ports nobody else has."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import pytest

from rackhand.bus import Bus, BusConfig, Inbox, Presence
from rackhand.schemas.service import CELL, ServiceId
from rackhand.testing.ports import free_port


@pytest.fixture(scope="module")
def router() -> Iterator[str]:
    """A router process; its end point."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    process = subprocess.Popen([sys.executable, "-m", "rackhand.bus.router", "--listen", endpoint])
    try:
        with Bus(ServiceId("probe", CELL), BusConfig(connect=endpoint)) as bus:
            wait_for(bus.inbox().watch_services(), ServiceId("router", CELL))
        yield endpoint
    finally:
        process.terminate()
        assert process.wait(timeout=10) == 0


def wait_for(inbox: Inbox, service: ServiceId, alive: bool = True) -> None:
    """Read until that service has come (or gone). The time-out only bounds a failure."""
    while (event := inbox.get(timeout=20)) != Presence(service, alive):
        assert event is not None, f"{service} did not {'come' if alive else 'go'}"
