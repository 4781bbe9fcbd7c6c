"""What a message becomes: values that say what is drawn, and where. Only the recording writes them to Rerun.

Entities are Rerun paths; frames are named, with ``MAP`` as their root. Metres, radians, quaternions w, x, y, z.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from rackhand.schemas.base import Quaternion, Vec3

MAP = "map"
TIMELINE = "sim_time"
BUS_LOG = "bus/log"
Level = Literal["INFO", "WARN", "ERROR"]


@dataclass(frozen=True)
class Drawing:
    """Shapes, in a frame. ``parts`` are Rerun archetypes.

    A ``static`` one holds for all of the recording, and the last one replaces all before it. A ``lasting`` one is
    drawn again now and then, so that those who come late have it.
    """

    entity: str
    parts: tuple[Any, ...]
    frame: str | None = MAP
    static: bool = False
    lasting: bool = False


@dataclass(frozen=True)
class Pose:
    """Where a frame is, in its parent frame."""

    frame: str
    position: Vec3
    orientation: Quaternion
    parent: str = MAP


@dataclass(frozen=True)
class Row:
    """One point in time of a plot: a number per curve."""

    entity: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class Note:
    """A line of a log."""

    entity: str
    text: str
    level: Level = "INFO"


def told_frame(robot: str, name: str) -> str:
    """A frame that the robot itself publishes. Bodies of a simulator have names with slashes: none is called so."""
    return f"{robot}:{name}"


Item = Drawing | Pose | Row | Note
