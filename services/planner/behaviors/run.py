"""What is known of the move that runs."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rackhand.services.planner.control.progress_checker import Phase, ProgressWatch
from rackhand.services.planner.control.route import Route
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.planning.plan import NoPathFound, Search, Target


@dataclass(frozen=True)
class PlanJob:
    """A search that goes on: from where, what it must beat, and whether it leaves out what is observed."""

    steps: Search
    start: Pose
    better_than: float
    on_map: bool


@dataclass
class Run:
    """The move that runs."""

    goal: Goal
    target: Target
    watch: ProgressWatch
    begun: int
    phase: Phase = "planning"
    route: Route | None = None
    had_plan: bool = False
    planned_at: int = 0
    blocked_since: int | None = None
    no_way_since: int | None = None
    search: PlanJob | None = None
    path_on_static_map: bool = False
    free: float = math.inf
    replanned: bool = False
    held: bool = False
    no_way: NoPathFound | None = None

    @property
    def turn_only(self) -> bool:
        return self.goal.x is None or self.goal.y is None
