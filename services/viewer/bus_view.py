"""The bus: liveliness of services, and how many messages each receives and loses."""

from __future__ import annotations

from collections.abc import Iterable

from rackhand.schemas.service import BusStats, ServiceId
from rackhand.services.viewer import colours
from rackhand.services.viewer.items import BUS_LOG, Item, Note, Row
from rackhand.services.viewer.shapes import curves

_SERVICES = ("planner", "controller", "gateway", "sim", "viewer", "recorder")


class BusView:
    """One robot's services (or the world's, or the cell's)."""

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self._named: set[str] = set()

    def begin(self) -> Iterable[Item]:
        return ()

    def stats(self, stats: BusStats) -> Iterable[Item]:
        who = f"{self.robot}/{stats.service}"
        if who not in self._named:
            self._named.add(who)
            yield from _curves(who)
        yield Row(f"bus/received/{who}", (float(stats.received),))
        yield Row(f"bus/lost/{who}/dropped", (float(stats.dropped),))
        yield Row(f"bus/lost/{who}/malformed", (float(stats.malformed),))


def _curves(who: str) -> Iterable[Item]:
    """A colour a service, the same in every plot."""
    service = who.rpartition("/")[2]
    colour = colours.SERIES[_SERVICES.index(service) if service in _SERVICES else -1]
    yield curves(f"bus/received/{who}", [who], [colour])
    for lost in ("dropped", "malformed"):
        yield curves(f"bus/lost/{who}/{lost}", [f"{who} {lost}"], [colour])


def presence(service: ServiceId, alive: bool) -> Note:
    return Note(BUS_LOG, f"{service} is {'up' if alive else 'down'}", "INFO" if alive else "WARN")
