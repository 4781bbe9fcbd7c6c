"""The last seconds of a move, and what held it: gathered tick by tick, at most a few hundred rows."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import NANOSECONDS, Twist2
from rackhand.schemas.explain import Held, PastPath
from rackhand.services.planner.behaviors.base import Status
from rackhand.services.planner.geometry.se2 import Pose

Array = NDArray[np.float64]
TRACE_NS = 10 * NANOSECONDS
ROWS = 251  # of the trace: 10 s of ticks
MOST_PATHS = 8
LONGEST_PATH = 400  # rows that are kept of one path
MOST_HOLDS = 12  # causes that are counted apart
AT_REST = 0.03  # m/s and rad/s
AT_LIMIT = 0.93  # of a limit, from which on it is what holds the chassis
_NUMBER = re.compile(r"\d+(\.\d+)?")


@dataclass(frozen=True)
class SpeedLimit:
    """The forward velocity that is commanded at most, m/s, where it is less than the chassis can do, and why."""

    velocity: float
    why: str
    setting: str = ""


@dataclass(frozen=True)
class Tick:
    """One tick of a move: ``pose`` None without a position; ``held_by``: why it waits; ``status``: of the behaviour;
    ``limit``: what limits its speed."""

    stamp: int
    pose: Pose | None
    measured: Twist2
    commanded: Twist2
    held_by: str | None
    status: Status
    limit: SpeedLimit | None = None


def holds(tick: Tick) -> tuple[str, str] | None:
    """What keeps the move from being faster at this tick, and the setting that does; None where nothing does."""
    if tick.held_by is not None:
        return tick.held_by, ""
    rests = max(abs(tick.measured.linear), abs(tick.measured.angular)) < AT_REST
    if rests and tick.status.viewport_blocked:
        return "an obstacle", ""
    if rests and tick.status.stuck_state != "none":
        return "no progress", ""
    if tick.limit is not None and tick.commanded.linear >= AT_LIMIT * tick.limit.velocity:
        return tick.limit.why, tick.limit.setting
    return None


class MoveTrace:
    """What one move did: the last 10 s of poses, twists and paths, and for how long what held it."""

    def __init__(self, stamp: int) -> None:
        self.begun = self.stamp = stamp
        self.driven = 0.0
        self._ticks: deque[Tick] = deque(maxlen=ROWS)
        self._paths: deque[PastPath] = deque(maxlen=MOST_PATHS)
        self._plans = 0
        self._held: dict[str, Held] = {}

    def note(self, tick: Tick) -> None:
        """Take one tick."""
        seconds = max(tick.stamp - self.stamp, 0) / NANOSECONDS
        self.stamp = max(self.stamp, tick.stamp)
        self.driven += abs(tick.measured.linear) * seconds
        self._ticks.append(tick)
        if tick.status.plans != self._plans and len(tick.status.path):
            self._plans = tick.status.plans
            poses = tick.status.path[:LONGEST_PATH].astype(np.float32)
            self._paths.append(PastPath(stamp=tick.stamp, poses=poses))
        if (cause := holds(tick)) is not None:
            self._add(*cause, seconds)

    def _add(self, by: str, setting: str, seconds: float) -> None:
        key = _NUMBER.sub("#", by)  # texts that differ in their numbers are one cause
        before = self._held.get(key)
        if before is None and len(self._held) >= MOST_HOLDS:
            key, by, before = "", "other causes", self._held.get("")
        total = seconds + (0.0 if before is None else before.seconds)
        self._held[key] = Held(by=by, seconds=total, setting=setting)

    @property
    def last(self) -> Tick | None:
        return self._ticks[-1] if self._ticks else None

    @property
    def seconds(self) -> float:
        """Since the move began."""
        return (self.stamp - self.begun) / NANOSECONDS

    def held(self) -> tuple[Held, ...]:
        """The longest first."""
        rounded = (held.model_copy(update={"seconds": round(held.seconds, 2)}) for held in self._held.values())
        return tuple(sorted(rounded, key=lambda held: -held.seconds))

    def rows(self) -> NDArray[np.float32]:
        """The trace of ``Explanation``: ticks with a pose, of the last 10 s."""
        rows = [
            ((t.stamp - self.stamp) / NANOSECONDS, *t.pose, t.measured.linear, t.measured.angular,
             t.commanded.linear, t.commanded.angular)
            for t in self._ticks
            if t.pose is not None and self.stamp - t.stamp <= TRACE_NS
        ]  # fmt: skip
        return np.array(rows, dtype=np.float32).reshape(-1, 8)

    def paths(self) -> tuple[PastPath, ...]:
        """Those that were followed in the last 10 s: the one before them too."""
        kept = list(self._paths)
        while len(kept) > 1 and self.stamp - kept[1].stamp > TRACE_NS:
            kept.pop(0)
        return tuple(kept)
