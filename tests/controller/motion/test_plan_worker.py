"""Plans beside the control loop: when they are taken over, and what happens to those that come too late."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

import numpy as np

from rackhand.services.controller.motion.plan_worker import FIRST_LEAD, LEAD_PER_POINT, PathPlanner
from rackhand.services.controller.motion.profile import MotionProfile, path_arm
from rackhand.services.controller.trajectory.model import PathRefused
from rackhand.services.controller.trajectory.queue import MotionQueue
from tests.controller.cell import UR5E

PERIOD = 0.004
IDLE = MotionQueue(path_arm(UR5E, MotionProfile.default(UR5E)), UR5E.home)


class Manual(Executor):
    """Does what it is given when the test says so."""

    def __init__(self) -> None:
        self.given: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.given.append((future, lambda: fn(*args, **kwargs)))
        return future

    def finish(self) -> None:
        future, work = self.given.pop(0)
        try:
            future.set_result(work())
        except Exception as error:
            future.set_exception(error)


def to(offset: float) -> Callable[[MotionQueue, float], MotionQueue]:
    return lambda queue, t: queue.append_joints(t, [UR5E.home + offset])


def test_from_rest_a_plan_is_driven_as_soon_as_it_is_there() -> None:
    executor = Manual()
    planner = PathPlanner(executor, PERIOD)
    planner.add(to(0.3), 1, "a")
    planner.begin(IDLE, 0.0, lockstep=False)
    assert planner.collect(0.004, tick=True, lockstep=False) == ([], None)
    executor.finish()
    answers, queue = planner.collect(0.5, tick=True, lockstep=False)
    assert [(a.ticket, a.error, a.first) for a in answers] == [("a", None, True)]
    assert queue is not None and queue.motions[0].begin == 0.5
    assert np.array_equal(queue.at(0.5).q, UR5E.home)
    assert not planner.busy


def test_beside_a_motion_a_late_plan_is_made_again_and_answered_once() -> None:
    executor = Manual()
    planner = PathPlanner(executor, PERIOD)
    moving = IDLE.append_joints(0.0, [UR5E.home + 1.5])
    planner.add(to(0.0), 1, "a")
    planner.begin(moving, 0.1, lockstep=False)
    begin = 0.1 + FIRST_LEAD + LEAD_PER_POINT
    assert planner.collect(begin + 0.02, tick=True, lockstep=False) == ([], None)
    executor.finish()
    answers, queue = planner.collect(begin + 0.05, tick=True, lockstep=False)
    assert [a.ticket for a in answers] == ["a"]
    assert queue is None, "made for a moment that is over"
    planner.begin(moving, begin + 0.05, lockstep=False)
    executor.finish()
    t = begin + 0.05
    while queue is None:
        t += PERIOD
        answers, queue = planner.collect(t, tick=True, lockstep=False)
        assert answers == []
        assert t < 1.0
    assert np.abs(queue.at(t).q - moving.at(t).q).max() < 1e-9, "spliced in without a jump"
    assert not planner.busy


def test_in_lockstep_a_due_plan_is_waited_for() -> None:
    class Slow(Manual):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            future = super().submit(fn, *args, **kwargs)
            executor = self

            class Waited(Future[Any]):
                def exception(self, timeout: float | None = None) -> BaseException | None:
                    if executor.given:
                        executor.finish()
                    return future.exception(timeout)

                def result(self, timeout: float | None = None) -> Any:
                    return future.result(timeout)

            return Waited()

    planner = PathPlanner(Slow(), PERIOD)
    planner.add(to(0.3), 1, "a")
    planner.begin(IDLE, 0.0, lockstep=True)
    assert planner.collect(0.0, tick=False, lockstep=True) == ([], None), "nothing is waited for between ticks"
    answers, queue = planner.collect(PERIOD, tick=True, lockstep=True)
    assert len(answers) == 1 and queue is not None


def test_a_refusal_is_reported_between_ticks_and_the_next_job_begins() -> None:
    executor = Manual()
    planner = PathPlanner(executor, PERIOD)
    planner.add(to(100.0), 1, "far")
    planner.add(to(0.1), 1, "near")
    planner.begin(IDLE, 0.0, lockstep=False)
    executor.finish()
    answers, queue = planner.collect(0.0, tick=False, lockstep=False)
    assert answers[0].ticket == "far" and isinstance(answers[0].error, PathRefused) and queue is None
    planner.begin(IDLE, 0.0, lockstep=False)
    executor.finish()
    answers, queue = planner.collect(0.0, tick=False, lockstep=False)
    assert answers[0].ticket == "near" and queue is not None


def test_cancelled_jobs_give_back_the_tickets_that_have_no_answer() -> None:
    executor = Manual()
    planner = PathPlanner(executor, PERIOD)
    moving = IDLE.append_joints(0.0, [UR5E.home + 1.5])
    planner.add(to(0.2), 1, "answered")
    planner.add(to(0.1), 1, "waiting")
    planner.begin(moving, 0.1, lockstep=False)
    executor.finish()
    planner.collect(0.1, tick=False, lockstep=False)
    assert planner.cancel() == ["waiting"]
    assert not planner.busy
