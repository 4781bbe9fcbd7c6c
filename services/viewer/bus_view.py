"""The bus: who is there, and how well each hears."""

from __future__ import annotations

from collections.abc import Iterable

from schemas.service import BusStats, ServiceId
from services.viewer.items import BUS_LOG, Item, Note, Row


class BusView:
    """One robot's services (or the world's, or the cell's)."""

    def __init__(self, robot: str) -> None:
        self.robot = robot

    def begin(self) -> Iterable[Item]:
        return ()

    def stats(self, stats: BusStats) -> Iterable[Item]:
        who = f"{self.robot}/{stats.service}"
        yield Row(f"bus/received/{who}", (float(stats.received),))
        yield Row(f"bus/lost/{who}/dropped", (float(stats.dropped),))
        yield Row(f"bus/lost/{who}/malformed", (float(stats.malformed),))


def presence(service: ServiceId, alive: bool) -> Note:
    return Note(BUS_LOG, f"{service} is {'there' if alive else 'gone'}", "INFO" if alive else "WARN")
