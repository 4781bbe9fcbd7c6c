"""Values that go into and come out of priority access. Times are nanoseconds of a monotonic clock."""

from __future__ import annotations

from dataclasses import dataclass
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
    """

    keep_alive_ns: int = 10 * SECOND
    min_keep_alive_ns: int = SECOND // 10
    on_loss: OnLoss = "softStop"
    on_release: Literal["finishPath", "softStop"] = "finishPath"
    strict_crf: bool = False
    reserved: tuple[tuple[int, frozenset[str]], ...] = ()
    force_roles: frozenset[str] = frozenset()
    max_clients: int = 256

    def __post_init__(self) -> None:
        if not 0 < self.min_keep_alive_ns <= self.keep_alive_ns:
            raise ValueError(f"keep-alive of {self.keep_alive_ns} ns, at least {self.min_keep_alive_ns} (and above 0)")


@dataclass(frozen=True)
class Caller:
    """Who asks, and what is logged of it."""

    client: str
    user: str = ""
    role: str = ""
    request_id: str = ""


# What happens to access.


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
    """The arm stands with an empty queue, all orders and commands up to ``serial`` done with."""

    serial: int


AccessInput = Lock | Unlock | Command | Stop | StartBeat | Beat | StopBeat | Disconnected | Tick | AtRest


# What comes of it.


@dataclass(frozen=True)
class StopMotion:
    """Brake: along the path within the deceleration limits (``softStop``) or as fast as can be. ``clear``: drop the
    queue; otherwise it is kept for ``ContinueMotion``. To be carried out before the command of the same outcome."""

    serial: int
    kind: StopKind
    clear: bool
    reason: str


@dataclass(frozen=True)
class ContinueMotion:
    """Go on with the queue that a ``StopMotion`` kept."""

    serial: int


Order = StopMotion | ContinueMotion


@dataclass(frozen=True)
class Decision:
    """Whether it was granted. ``after_rest``: a stop is under way, the command may begin only when it is done.

    ``serial`` numbers orders and admitted commands; ``AtRest`` refers to it.
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
class Outcome:
    """The answer and everything that follows from it, each in order."""

    verdict: Decision
    orders: tuple[Order, ...] = ()
    events: tuple[ControlEvent, ...] = ()
    audit: tuple[AuditEntry, ...] = ()
