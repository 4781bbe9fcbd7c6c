"""Where plans are made: beside the tick, because a long one takes seconds and a tick has milliseconds.

One request at a time; a new one takes the place of the one before. The answer is taken by a later tick: in lockstep by
the very next one, which waits for it, so that a run is the same on any machine; running free by the first one that
finds it, while the chassis goes on with the plan it has.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from threading import Event
from typing import cast

import numpy as np
from numpy.typing import NDArray

from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.map.grid import StaticMap
from rackhand.services.planner.planning.bottleneck import bottleneck
from rackhand.services.planner.planning.corridor import Corridor
from rackhand.services.planner.planning.doubt import still_there
from rackhand.services.planner.planning.plan import NoPathFound, Plan, Target
from rackhand.services.planner.planning.windows import LargePlanner
from rackhand.services.planner.settings import NavigationSettings


@dataclass(frozen=True)
class PlanRequest:
    """``static_only``: leave out observed obstacles. ``tight``: search with the footprint at once. ``corridor``: what
    the chassis' origin must not leave. ``clear_around``: metres about the target within which observed obstacles are
    left out, because they are the target itself. ``seen_within``: seconds; observed obstacles that were not seen
    since are left out: whole ones, or ``by_cell`` also what one that is there hides."""

    start: Pose
    target: Target
    static_only: bool = False
    tight: bool = False
    corridor: Corridor | None = None
    clear_around: float = 0.0
    seen_within: float = math.inf
    by_cell: bool = False


@dataclass(frozen=True)
class PlanningScene:
    """What is planned on: nothing in it changes while the worker reads it.

    ``observed``: flat indices of the map's cells that hold an observed obstacle; ``seen``: of those that were seen in
    the time that a request asks for, None for all.
    """

    static: StaticMap
    observed: NDArray[np.int64]
    footprint: Footprint
    settings: NavigationSettings
    seen: NDArray[np.int64] | None = None

    def planner(self, request: PlanRequest) -> LargePlanner:
        """On all cells that must be avoided."""
        observed = self.avoided(request)
        return LargePlanner(self.static.geometry, self.static.blocked, observed, self.footprint, self.settings)

    def avoided(self, request: PlanRequest) -> NDArray[np.int64]:
        """Flat indices of the cells with an observed obstacle that must be avoided."""
        observed, g = self.observed, self.static.geometry
        if request.static_only:
            return observed[:0]
        if self.seen is not None:
            observed = self.seen if request.by_cell else still_there(observed, self.seen, g)
        if request.clear_around:
            x = g.x + (observed % g.columns + 0.5) * g.resolution - request.target.x
            y = g.y + (observed // g.columns + 0.5) * g.resolution - request.target.y
            observed = observed[np.hypot(x, y) > request.clear_around]
        return observed


@dataclass(frozen=True)
class PlanAnswer:
    """A plan, or why there is none."""

    request: PlanRequest
    plan: Plan | None = None
    no_path: NoPathFound | None = None


@dataclass
class _Job:
    request: PlanRequest
    future: Future[Plan]
    cancelled: Event


class PlanWorker:
    """Runs requests on ``executor``, which has one thread. Not thread-safe itself: the tick's thread calls it."""

    def __init__(self, executor: Executor) -> None:
        self.lockstep = False
        self._executor = executor
        self._job: _Job | None = None

    @property
    def pending(self) -> PlanRequest | None:
        """The request that has no answer yet."""
        return None if self._job is None else self._job.request

    def submit(self, request: PlanRequest, scene: PlanningScene) -> None:
        """Begin a plan, in place of one that is pending."""
        self.cancel()
        cancelled = Event()
        self._job = _Job(request, self._executor.submit(_plan, request, scene, cancelled), cancelled)

    def cancel(self) -> None:
        """Drop the pending request; its answer is never given."""
        if self._job is not None:
            self._job.cancelled.set()
            self._job.future.cancel()
            self._job = None

    def collect(self) -> PlanAnswer | None:
        """The answer, once. In lockstep waits for it; otherwise None while it is not there.

        Whatever a plan raises but ``NoPathFound`` is raised here.
        """
        job = self._job
        if job is None or not (self.lockstep or job.future.done()):
            return None
        self._job = None
        try:
            return PlanAnswer(job.request, plan=job.future.result())
        except NoPathFound as no_path:
            return PlanAnswer(job.request, no_path=no_path)


def _plan(request: PlanRequest, scene: PlanningScene, cancelled: Event) -> Plan:
    if scene.seen is not None and len(scene.avoided(request)) == len(scene.observed):
        raise NoPathFound("disconnected", "there is nothing to doubt")
    planner = scene.planner(request)
    steps = planner.search(request.start, request.target, request.tight, request.corridor)
    while not cancelled.is_set():
        try:
            next(steps)
        except StopIteration as found:
            return cast(Plan, found.value)
        except NoPathFound as none:
            _find_bottleneck(none, request, scene)
            raise
    raise NoPathFound("budget", "the request was cancelled")


def _find_bottleneck(none: NoPathFound, request: PlanRequest, scene: PlanningScene) -> None:
    """Where the map is too narrow: for the inscribed circle, or else for a turn of the footprint on the spot."""
    if none.kind == "budget" or request.corridor is not None:
        return
    footprint = scene.footprint
    none.needed = footprint.inscribed if none.kind == "disconnected" else footprint.circumscribed
    blocked = scene.static.blocked.copy()
    blocked.reshape(-1)[scene.avoided(request)] = True
    start, target = request.start, request.target
    none.bottleneck = bottleneck(
        blocked, scene.static.geometry, (float(start[0]), float(start[1])), (target.x, target.y), none.needed
    )
