"""What each type of move does: one table from type to procedure. A new type of move is a new row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from rackhand.schemas.base import Pose2
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import DEPRECATED_MOVE_TYPES, MoveCreate
from rackhand.services.planner.behaviors.interface import Navigator, Progress
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.perception.chassis_state import Observation
from rackhand.services.planner.planning.goals import Goal

DEFAULT_ACCURACY = Goal.accuracy


class Procedure(Protocol):
    """How one move is carried out. Both methods raise ``MoveFailed``."""

    def start(self, navigator: Navigator, seen: Observation) -> None:
        """Begin, or after a pause go on from wherever the robot is now."""

    def tick(self, navigator: Navigator, seen: Observation) -> Progress:
        """One control step; ``arrived`` ends the move as succeeded."""

    def target(self, seen: Observation) -> Pose2 | None:
        """The pose clients are shown as the target; None for a move that is driven by an intent, as docking is."""


@dataclass(frozen=True)
class DriveTo:
    """A standard move: drive to a goal in the map around what is in the way."""

    goal: Goal

    def start(self, navigator: Navigator, seen: Observation) -> None:
        navigator.start(self.goal, seen)

    def tick(self, navigator: Navigator, seen: Observation) -> Progress:
        return navigator.tick(seen)

    def target(self, seen: Observation) -> Pose2 | None:
        goal = self.goal
        return Pose2(
            x=seen.pose.x if goal.x is None else goal.x,
            y=seen.pose.y if goal.y is None else goal.y,
            yaw=0.0 if goal.yaw is None else goal.yaw,
        )


def _standard(request: MoveCreate) -> Procedure:
    return DriveTo(
        Goal(
            x=request.target_x,
            y=request.target_y,
            yaw=request.target_ori,
            accuracy=request.target_accuracy or DEFAULT_ACCURACY,  # clients send 0 for "as usual"
            zone=bool(request.use_target_zone),
            rotate_in_place=request.properties.get("inplace_rotate") is True,
        )
    )


def _deprecated(request: MoveCreate) -> Procedure:
    raise MoveFailed(MoveFailReason.MOVE_ACTION_TYPE_DEPRECATED, f"moves of type {request.type} are deprecated")


PROCEDURES: dict[str, Callable[[MoveCreate], Procedure]] = {
    "none": _standard,
    "standard": _standard,
    **dict.fromkeys(sorted(DEPRECATED_MOVE_TYPES), _deprecated),
}


def procedure_for(request: MoveCreate) -> Procedure:
    """Raises ``MoveFailed``: with ``unknown`` for a type of the API that this version cannot carry out."""
    make = PROCEDURES.get(request.type)
    if make is None:
        raise MoveFailed(MoveFailReason.UNKNOWN, f"moves of type {request.type} are not available in this version")
    return make(request)
