"""When a status stream sends (spec motion-controller §2). Times are nanoseconds of one clock of the caller's choice."""

from __future__ import annotations

from rackhand.schemas.motion import MotionStatus

MIN_PERIOD_MS = 2


class StatusStream:
    """One connection's stream: at a frequency (mode 1), or at that frequency when something changed (mode 2).

    The period is in whole milliseconds as in CRF, and not below ``MIN_PERIOD_MS``. The first status is always sent.
    """

    def __init__(self, frequency: float, mode: int, now: int) -> None:
        self._next = now
        self._last: dict[str, object] | None = None
        self.change(frequency, mode, now)

    def change(self, frequency: float, mode: int, now: int) -> None:
        """A second start while active: the new period counts from ``now``, unless a status is due sooner."""
        self.period_ns = max(int(1000 / frequency), MIN_PERIOD_MS) * 1_000_000
        self.mode = mode
        self._next = min(self._next, now + self.period_ns)

    def due(self, status: MotionStatus, now: int) -> bool:
        """Whether ``status`` is to be sent now; if so it counts as sent."""
        if now < self._next:
            return False
        # Missed periods are not made up for.
        self._next += ((now - self._next) // self.period_ns + 1) * self.period_ns
        if self.mode == 1:
            return True
        # These change with time alone.
        content = status.model_dump(exclude={"stamp": True, "holder": {"lease_age": True}})
        if content == self._last:
            return False
        self._last = content
        return True


class StatusStreams:
    """The streams of all sessions, at most one each."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._streams: dict[str, StatusStream] = {}

    def __len__(self) -> int:
        return len(self._streams)

    def start(self, session: str, frequency: float, mode: int, now: int) -> bool:
        """A second start of a session changes its stream. False if there are too many streams."""
        active = self._streams.get(session)
        if active is not None:
            active.change(frequency, mode, now)
        elif len(self._streams) >= self._limit:
            return False
        else:
            self._streams[session] = StatusStream(frequency, mode, now)
        return True

    def stop(self, session: str) -> bool:
        """False if the session has none."""
        return self._streams.pop(session, None) is not None

    def due(self, status: MotionStatus, now: int) -> list[str]:
        """The sessions to send ``status`` to now; it counts as sent to them."""
        return [session for session, stream in self._streams.items() if stream.due(status, now)]
