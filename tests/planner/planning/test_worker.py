"""Plans beside the tick. The executor here does a job when the test says so."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.map.grid import load_map
from rackhand.services.planner.planning.plan import Target
from rackhand.services.planner.planning.worker import PlanningScene, PlanRequest, PlanWorker
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import BODY, Hall, box

START = np.array([1.5, 4.0, 0.0])


class ByHand(Executor):
    """Jobs wait until ``run``."""

    def __init__(self) -> None:
        self.jobs: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.jobs.append((future, lambda: function(*args, **kwargs)))
        return future

    def run(self) -> None:
        for future, job in self.jobs:
            if future.set_running_or_notify_cancel():
                try:
                    future.set_result(job())
                except Exception as error:
                    future.set_exception(error)
        self.jobs = []


def scene(observed: tuple[tuple[int, int], ...] = ()) -> PlanningScene:
    static = load_map(Hall(10, 8, [box(5, 4, 1, 2)]).map(), 0.4)
    cells = np.array([row * static.geometry.columns + column for row, column in observed], dtype=np.int64)
    return PlanningScene(static, cells, Footprint.of(BODY), NavigationSettings())


def request(x: float, y: float = 4.0, **more: Any) -> PlanRequest:
    return PlanRequest(START, Target(x, y, None), **more)


def test_running_free_the_answer_comes_when_it_is_there_and_once() -> None:
    executor = ByHand()
    worker = PlanWorker(executor)
    worker.submit(request(8.5), scene())
    assert worker.collect() is None and worker.pending is not None
    executor.run()
    answer = worker.collect()
    assert answer is not None and answer.plan is not None and answer.plan.length == pytest.approx(7.5, abs=0.6)
    assert worker.collect() is None and worker.pending is None


def test_in_lockstep_the_answer_is_waited_for() -> None:
    released = threading.Event()
    with ThreadPoolExecutor(1) as executor:
        executor.submit(released.wait)  # the worker is busy with something else
        worker = PlanWorker(executor)
        worker.submit(request(8.5), scene())
        assert worker.collect() is None
        worker.lockstep = True
        threading.Timer(0.1, released.set).start()
        answer = worker.collect()
    assert released.is_set()
    assert answer is not None and answer.plan is not None


def test_a_new_request_takes_the_place_of_the_one_before() -> None:
    executor = ByHand()
    worker = PlanWorker(executor)
    worker.submit(request(8.5), scene())
    second = request(1.5, 6.5)
    worker.submit(second, scene())
    executor.run()
    answer = worker.collect()
    assert answer is not None and answer.request is second


def test_no_path_is_an_answer_and_an_error_is_raised() -> None:
    executor = ByHand()
    worker = PlanWorker(executor)
    column = tuple((row, 160) for row in range(160))
    worker.submit(request(9.0), scene(column))
    executor.run()
    answer = worker.collect()
    assert answer is not None and answer.plan is None
    assert answer.no_path is not None and answer.no_path.kind == "disconnected"
    worker.submit(request(9.0, static_only=True), scene(column))
    executor.run()
    answer = worker.collect()
    assert answer is not None and answer.plan is not None, "the map alone has a path"
    worker.submit(PlanRequest(START, None), scene())  # type: ignore[arg-type]
    executor.run()
    with pytest.raises(AttributeError):
        worker.collect()


def test_the_scene_does_not_change_the_map() -> None:
    before = scene()
    with_crate = scene(((80, 60),))
    assert len(with_crate.avoided(request(9.0))) == 1 and not len(before.avoided(request(9.0)))
    assert with_crate.static.blocked.sum() == before.static.blocked.sum()


def test_what_is_observed_around_the_target_may_be_left_out() -> None:
    """Somebody to be followed is no obstacle to the way to him; what is farther from him is."""
    asked = request(9.0)
    g = scene().static.geometry
    row, column = g.cell(asked.target.x, asked.target.y)
    both = scene(((row, column + 4), (row, column + 12)))
    near, far = (row * g.columns + column + away for away in (4, 12))
    assert both.avoided(replace(asked, clear_around=0.4)).tolist() == [far]
    assert both.avoided(asked).tolist() == [near, far]
