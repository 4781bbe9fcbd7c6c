"""Who has asked for control: the holder, and those that wait for it."""

from __future__ import annotations

from dataclasses import dataclass

from rackhand.services.controller.access.types import OnLoss


@dataclass(frozen=True)
class Entry:
    """A client's request for control. ``refreshed`` [ns]: when it was last confirmed."""

    client: str
    priority: int
    keep_alive_ns: int
    on_loss: OnLoss
    refreshed: int

    def fresh(self, now: int) -> bool:
        return now - self.refreshed <= self.keep_alive_ns

    def is_of(self, client: str, priority: int) -> bool:
        """Identity in priority access is the pair of client and priority."""
        return (self.client, self.priority) == (client, priority)


class WaitingList:
    """CRF keeps a refused request: it is granted when those before it leave, as long as it is fresh.

    At most ``limit`` entries, one for each pair of priority and client.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._entries: dict[tuple[int, str], Entry] = {}

    def add(self, entry: Entry, now: int) -> None:
        """A full list drops what has expired first, and then the new entry."""
        key = (entry.priority, entry.client)
        if len(self._entries) >= self._limit and key not in self._entries:
            self._drop_expired(now)
        if key in self._entries or len(self._entries) < self._limit:
            self._entries[key] = entry

    def remove(self, client: str, priority: int) -> bool:
        """Whether there was such an entry."""
        return self._entries.pop((priority, client), None) is not None

    def remove_client(self, client: str) -> None:
        self._entries = {key: entry for key, entry in self._entries.items() if entry.client != client}

    def first(self, now: int) -> Entry | None:
        """The fresh entry of the smallest number; of equals the one that came first."""
        self._drop_expired(now)
        return min(self._entries.values(), key=lambda entry: entry.priority, default=None)

    def _drop_expired(self, now: int) -> None:
        self._entries = {key: entry for key, entry in self._entries.items() if entry.fresh(now)}
