"""The move that runs: its behaviour is made at the first tick, held while it must wait, and resumed where it was."""

from __future__ import annotations

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.base import Behavior, Context, Done, Drive, Status
from rackhand.services.planner.behaviors.registry import Registry, behavior_for
from rackhand.services.planner.behaviors.undock import Undock, undocking
from rackhand.services.planner.errors import MoveFailed, elapsed
from rackhand.services.planner.geometry.se2 import STANDSTILL, wrap

PATIENCE_NS = 10 * NANOSECONDS


class RunningMove:
    """``check`` and then either ``hold`` or ``step``, once a tick. All raise ``MoveFailed``."""

    def __init__(self, request: MoveCreate, registry: Registry, patience_ns: int = PATIENCE_NS) -> None:
        # As an angle: far out, the numbers of a float lie further apart than a turn.
        yaw = request.target_ori
        self._request = request if yaw is None else request.model_copy(update={"target_ori": wrap(yaw)})
        self._registry = registry
        self._patience_ns = patience_ns
        self._behavior: Behavior | None = None
        self._stepped = False
        self._undock: Undock | None = None
        self._waiting_since: int | None = None
        self._awaits_jack = False
        self.held_by: str | None = None
        self.paused = False

    @property
    def is_new(self) -> bool:
        """Whether the behaviour has not been stepped yet."""
        return not self._stepped

    def prepare(self) -> None:
        """Make the behaviour; raises for a type that none carries out, before anything is waited for."""
        if self._behavior is None:
            self._behavior = behavior_for(self._request, self._registry)

    def hold(self, why: str) -> None:
        """Wait this tick, as long as it takes."""
        self.held_by, self._waiting_since = why, None

    def hold_for_jack(self, direction: str) -> None:
        """Wait this tick for the jack, which travels."""
        self.hold(f"the jack is moving {direction}; the move starts when it has arrived")
        self._awaits_jack = True

    def check_jack(self, failure: str | None) -> None:
        """The jack has stopped: raises ``MoveFailed`` if this move waited for it and it did not arrive."""
        if self._awaits_jack and failure is not None:
            raise MoveFailed(MoveFailReason.PLATFORM_ALERT_ERROR, failure)
        self._awaits_jack = False

    def wait(self, trouble: str, stamp: int) -> None:
        """Wait this tick for what the move cannot do without; raises ``MoveFailed`` if it has lasted too long."""
        self.held_by = trouble
        if self._waiting_since is None:
            self._waiting_since = stamp
        if stamp - self._waiting_since >= self._patience_ns:
            text = f"{trouble}; the move waited for {self._patience_ns / NANOSECONDS:.0f} s"
            seconds, most = (stamp - self._waiting_since) / NANOSECONDS, self._patience_ns / NANOSECONDS
            waited = elapsed("time that the move waited", seconds, most)
            raise MoveFailed(MoveFailReason.PLATFORM_ALERT_ERROR, text).about(measures=(waited,))

    def step(self, ctx: Context) -> Drive | Done:
        """One control step of the behaviour; before its first one, those that drive out of what the chassis is in."""
        self.prepare()
        assert self._behavior is not None
        if not self._stepped:
            self._undock = undocking(ctx, self._request, self._behavior)
        current = self._undock or self._behavior
        if self.held_by is not None and self._stepped:
            current.resume(ctx)
        self.held_by = self._waiting_since = None
        self._stepped = True
        outcome = current.step(ctx)
        if self._undock is not None and isinstance(outcome, Done):
            self._undock = None
            return Drive(STANDSTILL, load=outcome.load)
        return outcome

    def status(self) -> Status:
        """Empty before the first step."""
        current = self._undock or self._behavior
        return Status() if current is None or not self._stepped else current.status()
