"""Inputs and outputs of priority access. Times are nanoseconds of a monotonic clock."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import ControlInfo, EventName, FencingToken, RefusalDetail

OnLoss = Literal["softStop", "finishPath", "hold"]
Takeover = Literal["stop", "continue"]
StopKind = Literal["softStop", "hardStop"]

SECOND = 1_000_000_000


@dataclass(frozen=True)
class AccessConfig:
    """How control is shared.

    ``on_loss`` is what a holder's motion does when its lock expires or its client vanishes: brake along the path and
    forget it, finish it, or brake and keep it until the same client resumes. ``on_release`` is the same after an
    unlock, which is no accident: stock clients lock, command and unlock around every call. ``reserved`` names the
    clients that may use a priority; other priorities are free. ``force_roles`` may take control from anybody.
    ``retry_ns``: for how long after its answer a repeated path is taken to be a retry (see ``ReplyMemory``).
    """

    keep_alive_ns: int = 10 * SECOND
    min_keep_alive_ns: int = SECOND // 10
    on_loss: OnLoss = "softStop"
    on_release: Literal["finishPath", "softStop"] = "finishPath"
    strict_crf: bool = False
    reserved: tuple[tuple[int, frozenset[str]], ...] = ()
    force_roles: frozenset[str] = frozenset()
    retry_ns: int = 5 * SECOND
    max_clients: int = 256

    def __post_init__(self) -> None:
        if not 0 < self.min_keep_alive_ns <= self.keep_alive_ns:
            raise ValueError(f"keep-alive of {self.keep_alive_ns} ns, at least {self.min_keep_alive_ns} (and above 0)")
        if self.retry_ns < 0:
            raise ValueError(f"retries are recognised for {self.retry_ns} ns, at least 0")


@dataclass(frozen=True)
class Caller:
    """Who asks, as far as it is logged."""

    client: str
    user: str = ""
    role: str = ""
    request_id: str = ""


# Inputs.


@dataclass(frozen=True)
class Lock:
    """``keep_alive_ns`` and ``on_loss`` of ``None`` are the configuration's."""

    caller: Caller
    priority: int
    keep_alive_ns: int | None = None
    on_loss: OnLoss | None = None
    takeover: Takeover = "stop"
    force: bool = False


@dataclass(frozen=True)
class Unlock:
    caller: Caller
    priority: int


@dataclass(frozen=True)
class Command:
    """A controlling command. ``moves``: it sets the arm in motion; ``resumes``: it lifts a latched stop; ``audited``:
    it is kept in the log even when accepted. ``epoch`` and ``lease`` are the token it carries, if any."""

    caller: Caller
    name: str
    priority: int
    moves: bool = True
    resumes: bool = False
    audited: bool = False
    epoch: str | None = None
    lease: int | None = None
    takeover: Takeover = "stop"


@dataclass(frozen=True)
class Stop:
    caller: Caller
    kind: StopKind
    priority: int | None = None


@dataclass(frozen=True)
class StartBeat:
    caller: Caller
    period_ns: int


@dataclass(frozen=True)
class Beat:
    caller: Caller


@dataclass(frozen=True)
class StopBeat:
    caller: Caller


@dataclass(frozen=True)
class Disconnected:
    client: str


@dataclass(frozen=True)
class Tick:
    """Time has passed."""


@dataclass(frozen=True)
class AtRest:
    """The arm is at rest with an empty queue; motion effects and commands up to ``serial`` are done."""

    serial: int


AccessInput = Lock | Unlock | Command | Stop | StartBeat | Beat | StopBeat | Disconnected | Tick | AtRest


# Outputs.


@dataclass(frozen=True)
class StopMotion:
    """Brake: along the path within the deceleration limits (``softStop``) or as fast as can be. ``clear``: drop the
    queue; otherwise it is kept for ``ContinueMotion``. It is carried out before the command of the same outcome."""

    serial: int
    kind: StopKind
    clear: bool
    reason: str


@dataclass(frozen=True)
class ContinueMotion:
    """Go on with the queue that a ``StopMotion`` kept."""

    serial: int


MotionEffect = StopMotion | ContinueMotion


@dataclass(frozen=True)
class Decision:
    """Whether it was granted. ``after_rest``: a stop is under way, the command may begin only when it is done.

    ``serial`` numbers motion effects and granted commands; ``AtRest`` refers to it.
    """

    ok: bool
    code: CrfCode = CrfCode.OK
    detail: RefusalDetail = RefusalDetail.NONE
    text: str = ""
    token: FencingToken | None = None
    keep_alive_ns: int = 0
    after_rest: bool = False
    serial: int = 0


@dataclass(frozen=True)
class ControlEvent:
    """An event to publish; ``to`` empty means everybody."""

    name: EventName
    to: str
    info: ControlInfo


@dataclass(frozen=True)
class AuditEntry:
    """One line of the audit log. ``monotonic_ns`` orders entries; the writer adds the time of day."""

    monotonic_ns: int
    action: str
    client: str
    user: str
    role: str
    priority: int
    epoch: str
    lease_id: int
    request_id: str
    code: int
    text: str


@dataclass(frozen=True)
class Effects:
    """What follows from an input, each in order: what to do with the motion, events to publish, lines to log."""

    motion: tuple[MotionEffect, ...] = ()
    events: tuple[ControlEvent, ...] = ()
    audit: tuple[AuditEntry, ...] = ()

    @classmethod
    def joined(cls, parts: Iterable[Effects]) -> Effects:
        """Of several inputs, in their order."""
        parts = tuple(parts)
        return Effects(
            tuple(effect for part in parts for effect in part.motion),
            tuple(event for part in parts for event in part.events),
            tuple(entry for part in parts for entry in part.audit),
        )


@dataclass(frozen=True)
class Outcome(Effects):
    """The decision about one input, and its effects."""

    decision: Decision = field(kw_only=True)
