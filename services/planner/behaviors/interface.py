"""What the moves of a chassis and its navigation say to each other: plain values, no bus, no clock."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import Twist2
from rackhand.schemas.chassis import ChassisModel, Costmap
from rackhand.schemas.maps import MapData
from rackhand.schemas.moves import StuckState
from rackhand.services.planner.perception.chassis_state import Observation
from rackhand.services.planner.planning.goals import Goal


@dataclass(frozen=True)
class Progress:
    """What navigation wants now, and how far it is."""

    twist: Twist2
    arrived: bool = False
    remaining_distance: float = 0.0
    stuck_state: StuckState = "none"
    path: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))
    replanned: bool = False
    viewport_blocked: bool = False


class Navigator(Protocol):
    """Drives one chassis to one goal at a time. Raises ``MoveFailed``; never publishes, never reads a clock."""

    def set_map(self, data: MapData | None) -> None:
        """Use this map with its overlays (or none) from now on. Raises ``MoveFailed(GET_MAP_FAILED)`` for a map that
        cannot be read. Forgets what was observed on the former one."""

    def set_model(self, model: ChassisModel) -> None:
        """Navigate this chassis from now on: its footprint, limits and actuation."""

    def reset(self) -> None:
        """Another run of the driver has begun: forget the goal and all that was measured."""

    def start(self, goal: Goal, seen: Observation) -> None:
        """Begin a move. Raises ``MoveFailed`` for what is wrong at once (no map, outside, not in ground, no way)."""

    def tick(self, seen: Observation) -> Progress:
        """One control step of the running move: the body twist to command now."""

    def observe(self, seen: Observation) -> None:
        """No move runs: keep the picture of the surroundings fresh."""

    def brake(self, seen: Observation) -> Twist2:
        """A twist that comes to rest within the deceleration limits (cancel, pause, emergency)."""

    def stop(self) -> None:
        """Forget the goal."""

    def costmap(self, stamp: int) -> Costmap | None:
        """What it steers by around the chassis; None without a map."""
