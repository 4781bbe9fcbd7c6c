"""When the world may go on: pausing, pacing to the wall, lockstep, and waiting for those who declared themselves.

Pure: stamps are simulation time in ns, ``now`` is any monotonic wall time in seconds that the shell hands in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from rackhand.schemas.service import ServiceId

RETELL_AFTER = (
    0.5  # s of wall time: an instant that nobody answers, and the clock of a world that stands, are told again
)
MAX_LAG_NS = 60_000_000  # running free, no command of a live participant grows older than this …
MAX_LAG_WAIT = 1.0  # … unless it stays out for so long (s of wall time)
CATCH_UP = 1.25  # times as fast as its pace goes a world that is behind: in a burst, controllers would miss states
LATE = 0.25  # s: a world that is later than this behind the wall goes on from where it is, instead of catching up


@dataclass(frozen=True)
class Decision:
    """What to do now. ``wait``: for at most ``seconds``, or until something is heard. ``retell``: publish the present
    instant again. ``tell_clock``: publish the clock alone.
    """

    kind: Literal["step", "retell", "tell_clock", "wait"]
    seconds: float = 0.0


@dataclass
class Participant:
    """Someone whose commands are waited for. ``joined`` is a stamp; ``lagging``: given up, until it answers again."""

    period_ns: int
    joined: int
    lagging: bool = False


class Pacer:
    """``awaited``: participants without whom time does not leave 0."""

    def __init__(
        self,
        control_step_ns: int,
        speed: float | None = 1.0,
        lockstep: bool = False,
        paused: bool = False,
        awaited: tuple[ServiceId, ...] = (),
    ) -> None:
        self._instant_ns = control_step_ns
        self._always_awaited = frozenset(awaited)
        self._awaited = set(awaited)
        self._speed = speed
        self.lockstep = lockstep
        self._paused = paused
        self._until: int | None = None
        self.participants: dict[ServiceId, Participant] = {}
        self.answers: dict[str, int] = {}
        self._anchor: tuple[float, int] | None = None
        self._told: float | None = None
        self._waiting: float | None = None
        self._stepped = -math.inf

    # -- what is wanted of it ----------------------------------------------------------------------------------------

    @property
    def speed(self) -> float | None:
        return self._speed

    @speed.setter
    def speed(self, speed: float | None) -> None:
        self._speed, self._anchor = speed, None

    @property
    def paused(self) -> bool:
        return self._paused

    def pause(self, paused: bool) -> None:
        self._paused, self._until, self._anchor = paused, None, None

    @property
    def until(self) -> int | None:
        """The stamp a paused world runs to, if it was told to advance."""
        return self._until

    def advance(self, until: int) -> None:
        """Let the paused world run until ``until``, and stand again; in lockstep once that instant is answered, so that
        what is asked of a participant then is asked after it, whatever the load of the machine.
        """
        self._until, self._anchor = until, None

    def reset(self) -> None:
        """Time begins at 0 again, and waits there for all who took part so far to join again."""
        self._awaited = {*self._always_awaited, *self.participants}
        self.participants.clear()
        self.answers.clear()
        self._until = self._anchor = self._told = self._waiting = None

    # -- who takes part ----------------------------------------------------------------------------------------------

    def join(self, service: ServiceId, period_ns: int, stamp: int) -> None:
        self.participants[service] = Participant(period_ns, stamp)
        self._awaited.discard(service)

    def leave(self, service: ServiceId) -> bool:
        """It takes part no more, or has gone. False if it did not take part."""
        if service not in self._always_awaited:
            self._awaited.discard(service)
        return self.participants.pop(service, None) is not None

    def answered(self, robot: str, answers: int) -> None:
        """The newest command of ``robot`` answers this instant."""
        self.answers[robot] = max(answers, self.answers.get(robot, answers))
        for service, participant in self.participants.items():
            if service.robot == robot:
                participant.lagging = False

    def missing(self, stamp: int) -> list[ServiceId]:
        """Who is to be heard before the world goes on from ``stamp``, whatever it costs."""
        absent = list(self._awaited) if stamp == 0 else []
        if self.lockstep:
            absent += [s for s, p in self.participants.items() if stamp % p.period_ns == 0 and self._newest(s) < stamp]
        return absent

    # -- the decision ------------------------------------------------------------------------------------------------

    def decide(self, stamp: int, now: float) -> Decision:
        """What to do now, standing at ``stamp``. A ``step`` is taken as done."""
        if self._until is not None and stamp >= self._until and not self.missing(stamp):
            self._until = None
        if self._paused and self._until is None:
            self._anchor = self._waiting = None
            return self._repeat("tell_clock", now)
        if self.missing(stamp) or self._holds_back(stamp, now):
            return self._repeat("retell", now)
        due = self._due(stamp, now)
        if now < due:
            return Decision("wait", due - now)
        self._told = self._waiting = None
        self._stepped = now
        return Decision("step")

    def _newest(self, service: ServiceId) -> int:
        return self.answers.get(service.robot, -1)

    def _holds_back(self, stamp: int, now: float) -> bool:
        """Running free: wait, for a bounded time, for those whose newest answer would grow too old."""
        if self.lockstep:
            return False
        late = [
            participant
            for service, participant in self.participants.items()
            if not participant.lagging
            and stamp + self._instant_ns - max(self._newest(service), participant.joined) > MAX_LAG_NS
        ]
        if not late:
            self._waiting = None
            return False
        if self._waiting is None:
            self._waiting = now
        if now - self._waiting < MAX_LAG_WAIT:
            return True
        for participant in late:
            participant.lagging = True
        return False

    def _repeat(self, kind: Literal["retell", "tell_clock"], now: float) -> Decision:
        if self._told is None:
            self._told = now
        if now - self._told >= RETELL_AFTER:
            self._told = now
            return Decision(kind)
        return Decision("wait", self._told + RETELL_AFTER - now)

    def _due(self, stamp: int, now: float) -> float:
        """The wall time from which on the state that follows ``stamp`` is to be there."""
        if self._speed is None:
            return now
        if self._anchor is None:
            self._anchor = (now, stamp)
        wall, anchored = self._anchor
        due = wall + (stamp + self._instant_ns - anchored) * 1e-9 / self._speed
        if now - due > LATE:
            self._anchor = (now, stamp + self._instant_ns)
            return now
        return max(due, self._stepped + self._instant_ns * 1e-9 / (self._speed * CATCH_UP))
