"""Which services are up: what their liveliness tokens say."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from rackhand.schemas.service import CELL, ServiceId

DEFAULT_GATEWAY = ServiceId("gateway", CELL)


@dataclass
class ServiceState:
    """One service: whether it is up, since when (unix seconds), how often it came back, restarted or reconnected: its
    token does not tell which."""

    alive: bool
    since: float
    restarts: int = 0


class Services:
    """All services seen so far. ``expected`` are those without which the cell is not up; ``this`` is the gateway."""

    def __init__(
        self, expected: Iterable[ServiceId] = (), started: float = 0.0, this: ServiceId = DEFAULT_GATEWAY
    ) -> None:
        self.expected = tuple(expected)
        self.started = started
        self.this = this
        self.known: dict[ServiceId, ServiceState] = {}

    def on_presence(self, service: ServiceId, alive: bool, now: float) -> None:
        """Take a token's change in; ``now`` in unix seconds."""
        known = self.known.get(service)
        if known is None:
            self.known[service] = ServiceState(alive, now)
        elif known.alive != alive:
            known.alive, known.since = alive, now
            known.restarts += alive

    def is_alive(self, service: ServiceId) -> bool:
        known = self.known.get(service)
        return known is not None and known.alive

    @property
    def all_up(self) -> bool:
        return all(map(self.is_alive, self.expected))

    @property
    def progress(self) -> float:
        """The share of the expected services that are up."""
        return sum(map(self.is_alive, self.expected)) / len(self.expected) if self.expected else 1.0
