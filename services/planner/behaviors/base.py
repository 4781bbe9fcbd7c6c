"""What every move type implements: ``step`` once a tick, ``resume`` after a hold, ``status`` for those who watch.

A behaviour gets a ``Context`` of values and returns what to drive; it publishes nothing, writes nothing and reads no
clock. The braking guard checks what it returns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.moves import PlanningFlag, StuckState
from rackhand.schemas.racks import DetectedRack
from rackhand.services.planner.control.dynamic_avoidance import DynamicAvoidance
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose, advanced
from rackhand.services.planner.load import Load
from rackhand.services.planner.perception.chassis_state import ChassisState
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.perception.seen_scan import SeenScan
from rackhand.services.planner.planning.worker import PlanningScene, PlanRequest, PlanWorker
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drive:
    """The twist wanted now.

    ``may_touch``: convex polygons, (n, 2) metres in the map frame, counter-clockwise: the braking guard ignores
    obstacles inside them, as the legs of the rack that the chassis drives under. ``load``: what the chassis is under
    from now on, where that changes.
    """

    twist: Twist2
    may_touch: tuple[Array, ...] = ()
    load: Load | None = None


@dataclass(frozen=True)
class Done:
    """The move has succeeded. The chassis brakes from whatever speed it has. ``load`` as in ``Drive``."""

    load: Load | None = None


@dataclass(frozen=True)
class Status:
    """What ``/planning_state`` and ``/path`` show of a running move.

    ``target`` is None for a move that has an ``intent_target`` instead, the pose of a rack or a charger as it is known
    by now; without either the requested pose is shown. ``path``: rows x, y, yaw ahead in the map frame. ``plans``
    counts the paths taken so far; from the second on it is a replanned one. ``passed_points``: of a given route.
    ``detected_rack``: what a search in the scan of this tick found; None without one. ``notice``: why there is no
    progress, where operators can help.
    """

    target: Pose2 | None = None
    intent: str = "none"
    intent_target: Pose2 | None = None
    path: Array = field(default_factory=lambda: np.empty((0, 3)))
    remaining_distance: float = 0.0
    stuck_state: StuckState = "none"
    viewport_blocked: bool = False
    plans: int = 0
    passed_points: int = 0
    flags: frozenset[PlanningFlag] = frozenset()
    detected_rack: DetectedRack | None = None
    notice: str = ""


@dataclass(frozen=True)
class Context:
    """What a behaviour knows at one tick.

    ``pose``: filtered, in the map frame, at ``stamp`` (ns). ``twist``: measured; ``commanded``: the last command.
    ``vetoed``: the braking guard did not let the last wanted twist pass. ``costmap``: the local costmap, whose
    ``static`` is the map; ``costmap.mask(polygon)`` leaves out what a behaviour may touch. ``seen``: the newest scan,
    the legs of a carried rack included; None before there is one that can be placed in the map.
    """

    stamp: int
    state: ChassisState
    pose: Pose
    twist: Twist2
    commanded: Twist2
    vetoed: bool
    costmap: LocalCostmap
    footprint: Footprint
    load: Load
    seen: SeenScan | None
    settings: NavigationSettings
    plans: PlanWorker
    avoidance: DynamicAvoidance

    @property
    def predicted(self) -> Pose:
        """The pose at which a command given now takes effect."""
        return advanced(self.pose, self.twist, self.settings.actuation.latency)

    def request_plan(self, request: PlanRequest) -> None:
        """Ask for a plan on the map and what is observed on it now; ``plans.collect()`` has the answer, a tick later at
        the earliest."""
        observed, within = self.costmap.observed_cells(), request.seen_within
        seen = self.costmap.observed_cells(within) if math.isfinite(within) else None
        scene = PlanningScene(self.costmap.static, observed, self.footprint, self.settings, seen)
        self.plans.submit(request, scene)


class Behavior(Protocol):
    """One move, from its first tick to its end. Methods raise ``MoveFailed``."""

    def step(self, ctx: Context) -> Drive | Done:
        """One control step."""

    def resume(self, ctx: Context) -> None:
        """A hold (emergency stop, pause, no position) is over: go on in the stage it interrupted. The chassis may have
        been pushed, and the time it was held does not count as being stuck. ``step`` follows at the same tick."""

    def status(self) -> Status:
        """As of the last ``step``."""
