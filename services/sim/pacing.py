"""When the simulation takes its next control step: pause, pacing to the wall clock, lockstep, and waiting for commands.

Pure: stamps are simulation time in ns, ``now`` is any monotonic wall time in seconds that the shell passes in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

from rackhand.schemas.service import ServiceId

C = TypeVar("C")

REPUBLISH_AFTER = 0.5  # s of wall time: a control step that nobody answers, and the clock of a pause, are sent again
MAX_LAG_NS = 60_000_000  # running free, no command of a live participant becomes older than this …
MAX_LAG_WAIT = 1.0  # … unless the participant does not answer for this long (s of wall time)
CATCH_UP = 1.25  # how much faster than its pace a simulation that is behind runs: in a burst, controllers miss states
LATE = 0.25  # s: a simulation that is later than this behind the wall clock continues from where it is


@dataclass(frozen=True)
class Decision:
    """What to do now. ``wait``: for at most ``seconds``, or until a message arrives. ``republish``: publish the present
    control step again. ``publish_clock``: publish the clock alone.
    """

    kind: Literal["step", "republish", "publish_clock", "wait"]
    seconds: float = 0.0


@dataclass
class Participant:
    """A service whose commands are waited for: one each ``period_ns`` from the stamp ``joined`` on.

    ``newest`` is the newest stamp that it answered. ``lagging``: not waited for until it answers again.
    """

    period_ns: int
    joined: int
    latency_ns: int = 0
    newest: int = -1
    lagging: bool = False

    def owes(self, stamp: int) -> bool:
        """Whether the answer to its newest period that began at or before ``stamp`` is missing."""
        due = stamp - stamp % self.period_ns
        return due >= self.joined and self.newest < due


class CommandSchedule(Generic[C]):
    """Commands that have arrived and wait for the control step at which they take effect."""

    def __init__(self) -> None:
        self._waiting: list[tuple[int, str, C]] = []

    def add(self, robot: str, effective: int, command: C) -> None:
        """``effective``: the stamp of the first control step that this command drives."""
        self._waiting.append((effective, robot, command))

    def take_due(self, stamp: int) -> list[tuple[str, C]]:
        """Those that take effect at the control step that begins at ``stamp``, in order of their stamps."""
        if not self._waiting:
            return []
        due = [entry for entry in self._waiting if entry[0] <= stamp]
        if due:
            self._waiting = [entry for entry in self._waiting if entry[0] > stamp]
            due.sort(key=lambda entry: entry[0])
        return [(robot, command) for _, robot, command in due]

    def drop(self, robot: str) -> None:
        self._waiting = [entry for entry in self._waiting if entry[1] != robot]

    def clear(self) -> None:
        self._waiting.clear()


class Pacer:
    """``awaited``: participants without whom time does not leave 0.

    In lockstep the control step at stamp s begins once every participant has answered s - its command latency.
    """

    def __init__(
        self,
        control_step_ns: int,
        speed: float | None = 1.0,
        lockstep: bool = False,
        paused: bool = False,
        awaited: tuple[ServiceId, ...] = (),
    ) -> None:
        self._step_ns = control_step_ns
        self._always_awaited = frozenset(awaited)
        self._awaited = set(awaited)
        self._speed = speed
        self.lockstep = lockstep
        self._paused = paused
        self._until: int | None = None
        self.participants: dict[ServiceId, Participant] = {}
        self.answers: dict[str, int] = {}
        self._anchor: tuple[float, int] | None = None
        self._published: float | None = None
        self._waiting: float | None = None
        self._stepped = -math.inf

    # -- settings ----------------------------------------------------------------------------------------------------

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
        """The stamp that a paused simulation advances to, if it was asked to."""
        return self._until

    def advance(self, until: int) -> None:
        """Run the paused simulation until ``until``, then pause again. In lockstep the pause begins once that step is
        answered, so that a request to a participant afterwards comes after the answer at any load of the machine.
        """
        self._until, self._anchor = until, None

    def reset(self) -> None:
        """Time begins at 0 again, and waits there until all participants so far have joined again."""
        self._awaited = {*self._always_awaited, *self.participants}
        self.participants.clear()
        self.answers.clear()
        self._until = self._anchor = self._published = self._waiting = None

    # -- participants ------------------------------------------------------------------------------------------------

    def join(self, service: ServiceId, period_ns: int, stamp: int, latency_ns: int = 0) -> None:
        """A repeated declaration of the same period and latency changes nothing."""
        known = self.participants.get(service)
        if known is None or (known.period_ns, known.latency_ns) != (period_ns, latency_ns):
            self.participants[service] = Participant(period_ns, stamp, latency_ns)
        self._awaited.discard(service)

    def leave(self, service: ServiceId) -> bool:
        """It no longer takes part. False if it did not take part."""
        if service not in self._always_awaited:
            self._awaited.discard(service)
        return self.participants.pop(service, None) is not None

    def effective(self, robot: str, answers: int) -> int | None:
        """The stamp from which on the answer to ``answers`` is in force; None for a repeated one, which changes
        nothing. Running free, a command is in force as soon as it arrives.
        """
        participant = self._commander(robot)
        if participant is None or not self.lockstep:
            return answers
        return None if answers <= participant.newest else answers + participant.latency_ns

    def answered(self, robot: str, answers: int) -> None:
        """The newest command of ``robot`` answers this stamp."""
        self.answers[robot] = max(answers, self.answers.get(robot, answers))
        if (participant := self._commander(robot)) is not None:
            participant.newest = max(participant.newest, answers)
            participant.lagging = False

    def is_read(self, robot: str, stamp: int) -> bool:
        """Whether a period of the robot's commander begins at ``stamp``, or nobody has declared any."""
        participant = self._commander(robot)
        return participant is None or stamp % participant.period_ns == 0

    def missing(self, stamp: int) -> list[ServiceId]:
        """Who must join or answer before the control step at ``stamp`` begins, however long that takes."""
        absent = list(self._awaited) if stamp == 0 else []
        if self.lockstep:
            absent += [service for service, p in self.participants.items() if p.owes(stamp - p.latency_ns)]
        return absent

    def unanswered(self, stamp: int) -> list[ServiceId]:
        """In lockstep: who has not answered all of its periods that began at or before ``stamp``."""
        return [service for service, p in self.participants.items() if p.owes(stamp)] if self.lockstep else []

    def _commander(self, robot: str) -> Participant | None:
        return next((p for service, p in self.participants.items() if service.robot == robot), None)

    # -- the decision ------------------------------------------------------------------------------------------------

    def decide(self, stamp: int, now: float) -> Decision:
        """What to do now, with the simulation at ``stamp``. A ``step`` counts as taken."""
        if self._until is not None and stamp >= self._until:
            if self.missing(stamp) or self.unanswered(stamp):
                return self._repeat("republish", now)
            self._until = None
        if self._paused and self._until is None:
            self._anchor = self._waiting = None
            return self._repeat("publish_clock", now)
        if self.missing(stamp) or self._holds_back(stamp, now):
            return self._repeat("republish", now)
        due = self._due(stamp, now)
        if now < due:
            return Decision("wait", due - now)
        self._published = self._waiting = None
        self._stepped = now
        return _STEP

    def _holds_back(self, stamp: int, now: float) -> bool:
        """Running free: wait, for a bounded time, for those whose newest answer would become too old."""
        if self.lockstep:
            return False
        late = [
            participant
            for participant in self.participants.values()
            if not participant.lagging
            and stamp + self._step_ns - max(participant.newest, participant.joined) > MAX_LAG_NS
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

    def _repeat(self, kind: Literal["republish", "publish_clock"], now: float) -> Decision:
        if self._published is None:
            self._published = now
        if now - self._published >= REPUBLISH_AFTER:
            self._published = now
            return Decision(kind)
        return Decision("wait", self._published + REPUBLISH_AFTER - now)

    def _due(self, stamp: int, now: float) -> float:
        """The wall time at which the step from ``stamp`` is due."""
        if self._speed is None:
            return now
        if self._anchor is None:
            self._anchor = (now, stamp)
        wall, anchored = self._anchor
        due = wall + (stamp + self._step_ns - anchored) * 1e-9 / self._speed
        if now - due > LATE:
            self._anchor = (now, stamp + self._step_ns)
            return now
        return max(due, self._stepped + self._step_ns * 1e-9 / (self._speed * CATCH_UP))


_STEP = Decision("step")
