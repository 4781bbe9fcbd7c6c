"""Paths are planned beside the control loop, because a long one takes seconds and a tick has milliseconds.

A job is planned from the queue as it is when the job's turn comes, for a tick a little ahead, and is spliced in at that
very tick. In lockstep the tick waits for the plan, so that a run is the same on any machine. Running free it does not:
the current motion continues, and a plan that comes too late is made again for a later tick; one that begins at rest is
driven as soon as the arm has arrived. The caller is answered as soon as its path is planned, before it is driven.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, Future, wait
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from rackhand.services.controller.trajectory.queue import MotionQueue
from rackhand.services.controller.trajectory.stream import Motion

Append = Callable[[MotionQueue, float], MotionQueue]

T = TypeVar("T")

MAX_JOBS = 64
FIRST_LEAD = 0.04  # seconds a plan is given beside a motion under way, and for each of its points, the first time
LEAD_PER_POINT = 0.002


@dataclass
class _Job(Generic[T]):
    append: Append
    points: int
    ticket: T
    begin: float = 0.0
    ends: float = math.inf  # when the motions before it end, if that is before ``begin``: then it begins at rest
    lead: float = 0.0
    from_rest: bool = False
    answered: bool = False
    future: Future[MotionQueue] | None = None


@dataclass(frozen=True)
class Answered(Generic[T]):
    """A job's plan is known: it will be driven, or ``error`` says why not. ``first``: its caller has no answer yet."""

    ticket: T
    error: BaseException | None
    first: bool


class PathPlanner(Generic[T]):
    """One job at a time, in order of arrival. Times are seconds of the arm's clock; ``period`` that of the ticks."""

    def __init__(self, executor: Executor, period: float) -> None:
        self._executor = executor
        self._period = period
        self._jobs: deque[_Job[T]] = deque()

    @property
    def busy(self) -> bool:
        return bool(self._jobs)

    @property
    def full(self) -> bool:
        return len(self._jobs) >= MAX_JOBS

    def add(self, append: Append, points: int, ticket: T) -> None:
        self._jobs.append(_Job(append, points, ticket))

    def cancel(self) -> list[T]:
        """Drops every job; the tickets of those without an answer."""
        dropped, self._jobs = self._jobs, deque()
        for job in dropped:
            if job.future is not None:
                job.future.cancel()
        return [job.ticket for job in dropped if not job.answered]

    def begin(self, queue: MotionQueue, t: float, lockstep: bool) -> None:
        """Starts planning the first job, unless that is under way. ``t`` is the time of the last tick."""
        job = self._jobs[0] if self._jobs else None
        if job is None or job.future is not None:
            return
        job.from_rest = not queue.motions
        if lockstep or job.from_rest:
            ticks = 1
        else:
            job.lead = max(job.lead, FIRST_LEAD + LEAD_PER_POINT * job.points)
            ticks = math.ceil(job.lead / self._period)
        job.begin = t + ticks * self._period
        end = queue.motions[-1].motion.end if queue.motions and not queue.paused else math.inf
        job.ends = end if end <= job.begin else math.inf
        job.future = self._executor.submit(job.append, queue, job.begin)

    def await_plan(self, seconds: float) -> None:
        """Wait for the plan that is being made, so long at most."""
        if self._jobs and self._jobs[0].future is not None:
            wait([self._jobs[0].future], seconds)

    def collect(self, t: float, tick: bool, lockstep: bool) -> tuple[list[Answered[T]], MotionQueue | None]:
        """Answers that are known, and the queue to drive from ``t`` on if there is a new one.

        ``t`` is the time of this tick or, between two, of the last one. ``lockstep``: a plan that is due at this tick
        is waited for.
        """
        answers: list[Answered[T]] = []
        job = self._jobs[0] if self._jobs else None
        if job is None or job.future is None:
            return answers, None
        due = tick and t > job.begin - 0.5 * self._period
        if not (job.future.done() or (lockstep and due)):
            return answers, None
        error = job.future.exception()
        if error is not None or not job.answered:
            answers.append(Answered(job.ticket, error, not job.answered))
            job.answered = True
        if error is not None:
            self._jobs.popleft()
            return answers, None
        queue = job.future.result()
        if job.from_rest:
            # The arm waits for it: it may be taken over before its time, and be shifted when that is over.
            self._jobs.popleft()
            return answers, _shifted(queue, max(0.0, t - job.begin))
        if not due and t >= job.ends:
            # The arm has arrived before the plan was due.
            self._jobs.popleft()
            return answers, _shifted(queue, t + self._period - job.begin)
        if not due:
            return answers, None
        late = t - job.begin
        if late > 0.5 * self._period:
            # Made for a moment that is over. Twice the time it took will do, or the next time will.
            job.lead, job.future = 2 * (job.lead + late), None
            return answers, None
        self._jobs.popleft()
        return answers, queue


def _shifted(queue: MotionQueue, by: float) -> MotionQueue:
    """``queue``, which begins at rest, ``by`` seconds later."""
    if by == 0:
        return queue
    motions = tuple(
        replace(queued, motion=queued.motion.shifted(by), begin=queued.begin + by)
        for queued in queue.motions
        if isinstance(queued.motion, Motion)
    )
    return replace(queue, motions=motions)
