"""Whether the driver follows this controller's commands, and when it got them. Pure; times are stamps of arm states."""

from __future__ import annotations

from rackhand.schemas.motion import ArmState

PATIENCE_NS = 60_000_000  # what was sent needs its way, and a driver may lose a command
COUNTED = 2  # periods, of the time between two looks at most
OLDEST_NS = 250_000_000  # a driver has stopped the arm by then
LOST = 1.5  # periods by which the command that a driver follows is older than usual: two or more have not come
FORGETS = 0.005  # share of an older command's age by which the usual one grows


class DriverWatch:
    """A driver that does not report what it follows (``ArmState.follows``) is trusted.

    ``fault`` is asked once in each ``period_ns``. Where that came late, the driver had nothing newer to follow: of such
    a gap no more than ``COUNTED`` periods count.
    """

    def __init__(self, period_ns: int) -> None:
        self._most = COUNTED * period_ns
        self.reset()

    def reset(self) -> None:
        """A new epoch: the driver has not heard of it."""
        self._last = 0
        self._wrong_for: int | None = None  # ns; None while it obeys

    def fault(self, state: ArmState, epoch: str) -> str:
        """Why commands of ``epoch`` do not move the arm; empty while they do, or may soon."""
        wrong = _wrong(state, epoch)
        gap, self._last = state.stamp - self._last, state.stamp
        if not wrong:
            self._wrong_for = None
        elif self._wrong_for is None or gap < 0:
            self._wrong_for = 0
        else:
            self._wrong_for += min(gap, self._most)
        return wrong if (self._wrong_for or 0) > PATIENCE_NS else ""

    def obeys(self, state: ArmState, epoch: str) -> bool:
        """Whether it follows a command of ``epoch`` now."""
        return not _wrong(state, epoch)


class CommandDelay:
    """Whether commands are late at the driver, one of which there is each ``period_ns``.

    A controller that answers every state in time cannot see by itself that its answers wait somewhere. ``usual`` is the
    least age of the command that the driver follows, which contains its own latency. A driver that does not report what
    it follows is taken to be in time.
    """

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self.reset()

    def reset(self) -> None:
        """The driver may be another."""
        self._usual: float | None = None

    def late(self, state: ArmState) -> bool:
        """Whether the command that is followed at ``state`` is older than usual. At every tick."""
        if state.follows is None or state.follows.token is None:
            return False
        age = state.stamp - state.follows.answers
        usual = age if self._usual is None else min(age, self._usual)
        self._usual = usual + FORGETS * (age - usual)
        return age > usual + LOST * self._period_ns


def _wrong(state: ArmState, epoch: str) -> str:
    follows = state.follows
    if follows is None:
        return ""
    if follows.token is None:
        return "the arm driver follows no command"
    if follows.token.epoch != epoch:
        return f"the arm driver follows another controller (epoch {follows.token.epoch}, lease {follows.token.lease})"
    age = state.stamp - follows.answers
    return f"the arm driver follows a command that is {age / 1e6:.0f} ms old" if age > OLDEST_NS else ""
