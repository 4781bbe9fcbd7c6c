"""The score of the BARN challenge, and where it is lost. Values in, values out."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

BEST = 0.5
TOP_SPEED = 2.0  # m/s, by which the organisers take the optimal time
FASTEST, SLOWEST = 2.0, 8.0  # times the optimal time, between which a run's time is clipped
STANDING, CREEPING, SLOW = 0.05, 0.3, 1.0  # m/s; below each
KINDS = ("standing", "creeping", "slow", "fast")


@dataclass(frozen=True)
class Result:
    """One run: ``time`` in s from the request to the end, ``optimal`` in s, ``off`` in m from the goal at the end, and
    the seconds at each kind of speed (``KINDS``)."""

    world: str
    state: str
    time: float
    optimal: float
    off: float
    contacts: int
    seconds: tuple[float, ...]
    why: str = ""

    @property
    def succeeded(self) -> bool:
        return self.state == "succeeded" and self.contacts == 0

    @property
    def score(self) -> float:
        """Organisers' formula since 2023: success · OT / clip(AT, 2·OT, 8·OT)."""
        if not self.succeeded:
            return 0.0
        return self.optimal / min(max(self.time, FASTEST * self.optimal), SLOWEST * self.optimal)

    @property
    def ratio(self) -> float:
        return self.time / self.optimal

    def record(self) -> dict[str, object]:
        """As JSON has it."""
        return asdict(self)

    @staticmethod
    def of(record: dict[str, object]) -> Result:
        fields = dict(record)
        fields["seconds"] = tuple(fields["seconds"])  # type: ignore[arg-type]
        return Result(**fields)  # type: ignore[arg-type]


def speed_kinds(path: Sequence[tuple[float, float]], period: float) -> tuple[float, ...]:
    """Seconds at each kind of speed, of positions that are ``period`` s apart."""
    seconds = dict.fromkeys(KINDS, 0.0)
    for (x0, y0), (x1, y1) in itertools.pairwise(path):
        speed = math.hypot(x1 - x0, y1 - y0) / period
        kind = next(
            (k for k, limit in zip(KINDS, (STANDING, CREEPING, SLOW), strict=False) if speed < limit), KINDS[-1]
        )
        seconds[kind] += period
    return tuple(round(value, 3) for value in seconds.values())


def cause(result: Result) -> str:
    """What the score of a run was lost by; empty if nothing was."""
    if result.contacts:
        return "contact"
    if result.state != "succeeded":
        return "not arrived"
    if result.score >= BEST - 1e-9:
        return ""
    slower = max(zip(result.seconds, KINDS, strict=True))[1]
    return {"standing": "stands", "creeping": "creeps", "slow": "drives slowly"}.get(slower, "long way")
