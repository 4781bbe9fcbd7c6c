"""Heartbeats: clients that are supervised to send one at least once per period (spec motion-controller §1.5)."""

from __future__ import annotations


class Heartbeats:
    """At most ``limit`` clients. Times are nanoseconds of the caller's monotonic clock."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._clients: dict[str, tuple[int, int]] = {}  # period and last beat

    def __len__(self) -> int:
        return len(self._clients)

    def __contains__(self, client: str) -> bool:
        return client in self._clients

    def start(self, client: str, period_ns: int, now: int) -> bool:
        """A second start changes the period. False if too many clients are watched."""
        if client not in self._clients and len(self._clients) >= self._limit:
            return False
        self._clients[client] = (period_ns, now)
        return True

    def beat(self, client: str, now: int) -> None:
        self._clients[client] = (self._clients[client][0], now)

    def stop(self, client: str) -> None:
        self._clients.pop(client, None)

    def expired(self, now: int) -> list[str]:
        """The clients whose last beat is older than their period; they are watched no longer."""
        late = [client for client, (period, last) in self._clients.items() if now - last > period]
        for client in late:
            del self._clients[client]
        return late
