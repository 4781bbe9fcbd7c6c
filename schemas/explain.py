"""Why a move failed, waits or is slow: what is kept of it, and the answer to who asks. Metres, radians, map frame."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, Strict

from rackhand.schemas.base import Array, Message, Pose2, Stamp
from rackhand.schemas.chassis import Costmap
from rackhand.schemas.moves import Move

ThingKind = Literal[
    "mapped obstacle",
    "unknown ground",
    "virtual wall",
    "no-go zone",
    "observed obstacle",
    "moving obstacle",
    "rack",
    "rack leg",
    "rack point",
    "charger",
    "lift",
    "lift door",
    "edge of the map",
    "route point",
    "goal",
    "chassis",
    "place",
]
Role = Literal["blocks", "expected", "seen"]
"""What a thing has to do with the move: it is in the way, it was looked for, or it was there instead."""
Verdict = Literal["failed", "cancelled", "waiting", "stuck", "slow", "moving", "succeeded"]


class Thing(Message):
    """A thing that explains a move, and where it is.

    ``clearance``: metres between it and the footprint of the chassis at ``at``, negative where they overlap;
    ``needed``: the clearance that the chassis must have there. Both are None for what has no clearance.
    """

    role: Role
    kind: ThingKind
    name: str = ""
    x: float
    y: float
    clearance: float | None = None
    needed: float | None = None
    at: Pose2 | None = None

    @property
    def title(self) -> str:
        """``virtual wall 'north'``, or ``seen: rack leg``"""
        name = f" {self.name!r}" if self.name else ""
        return f"{'' if self.role == 'blocks' else f'{self.role}: '}{self.kind}{name}"

    @property
    def sentence(self) -> str:
        """``virtual wall 'north' at (3.00, 1.20): clearance -0.05 m, needed 0.05 m``"""
        what = f"{self.title} at ({self.x:.2f}, {self.y:.2f})"
        if self.clearance is None:
            return what
        needed = "" if self.needed is None else f", needed {self.needed:.2f} m"
        return f"{what}: clearance {self.clearance:.2f} m{needed}"


class Measure(Message):
    """A number that decided: what was measured against what was expected. ``setting``: the parameter that holds the
    expected value, where it is one."""

    name: str
    value: float
    expected: float | None = None
    unit: str = ""
    setting: str = ""


class Evidence(Message):
    """What is known of a cause where it is found."""

    things: Annotated[tuple[Thing, ...], Strict(False)] = ()
    measures: Annotated[tuple[Measure, ...], Strict(False)] = ()


class Held(Message):
    """What kept a move from driving as fast as the chassis can, and for how many seconds in all. ``setting``: the
    parameter that did, where it was one."""

    by: str
    seconds: Annotated[float, Field(ge=0)]
    setting: str = ""


class PastPath(Message):
    """A path as it was planned ``stamp`` ns: rows x, y, yaw."""

    stamp: Stamp
    poses: Annotated[np.ndarray, Array("<f4", (-1, 3))]


class Explanation(Message):
    """A move explained: in words, and the evidence.

    ``duration``: seconds from its creation to its end, or until now; ``driven``: metres. ``trace``: the last 10 s, rows
    t, x, y, yaw, measured linear and angular velocity, commanded linear and angular velocity, with t in seconds before
    ``stamp`` (negative). ``footprint``: corners in the map at the last pose.
    """

    stamp: Stamp
    move: Move
    verdict: Verdict
    cause: str
    advice: str = ""
    evidence: Evidence = Field(default_factory=Evidence)
    held: Annotated[tuple[Held, ...], Strict(False)] = ()
    duration: float = 0.0
    driven: float = 0.0
    pose: Pose2 | None = None
    footprint: Annotated[np.ndarray, Array("<f4", (-1, 2))]
    trace: Annotated[np.ndarray, Array("<f4", (-1, 8))]
    paths: Annotated[tuple[PastPath, ...], Strict(False)] = ()
    costmap: Costmap | None = None


class ExplainMove(Message):
    """Explain one move by id; without an id, the running or last one. Refused as not_found for a move that is not
    kept."""

    id: int | None = None


class ExplainReply(Message):
    explanation: Explanation


class RecordMove(Message):
    """Make a recording of a move of ``robot``, as its planner has explained it."""

    robot: str
    explanation: Explanation


class MoveRecording(Message):
    """``data``: a file of Rerun's format ``.rrd``."""

    data: bytes
