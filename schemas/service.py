"""Liveliness tokens of services, and counts of what each has received and lost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from rackhand.schemas.base import Message

WORLD = "world"
DRIVER = "driver"  # what drives a robot: a hardware driver, or the simulator in its place
CELL = "cell"


@dataclass(frozen=True)
class ServiceId:
    """One running service: its name, and the robot it serves (``world`` for the sim, ``cell`` for the rest)."""

    service: str
    robot: str

    @property
    def key(self) -> str:
        """The key of its liveliness token."""
        return f"rackhand/{self.robot}/alive/{self.service}"

    @staticmethod
    def from_key(key: str) -> ServiceId:
        _, robot, _, service = key.split("/")
        return ServiceId(service, robot)

    def __str__(self) -> str:
        return f"{self.robot}/{self.service}"


ALIVE_EVERYWHERE = "rackhand/*/alive/*"

Count = Annotated[int, Field(ge=0)]


class BusStats(Message):
    """What one service's inboxes have taken in since it started: samples and requests read, samples that newer ones
    pushed out unread, and what did not parse."""

    service: str
    received: Count
    dropped: Count
    malformed: Count
