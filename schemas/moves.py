"""Moves of a chassis: requests, stored moves, and the topics published while one runs (seeds 000, 001, 004)."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import Field

from rackhand.schemas.base import Array, Message, Pose2, Stamp

MoveState = Literal["idle", "moving", "succeeded", "failed", "cancelled"]
StuckState = Literal["none", "move_stucked", "target_spin_stucked"]
PlanningFlag = Literal[
    "aligning_with_rack",
    "in_elevator",
    "is_waiting_for_dest",
    "undocking_charger_or_rack",
    "unloading_rack",
    "waiting_for_charge",
]
"""What is true of a move now; ``/planning_state`` has a key of that name while it is."""
TERMINAL: frozenset[str] = frozenset({"succeeded", "failed", "cancelled"})

MoveType = Literal[
    "none",
    "standard",
    "charge",
    "return_to_elevator_waiting_point",
    "enter_elevator",
    "leave_elevator",
    "pull_over",
    "along_given_route",
    "align_with_rack",
    "to_unload_point",
    "follow_target",
    "parking",
    "along_central_line",
]
MOVE_TYPES: tuple[str, ...] = get_args(MoveType)
INTENT_MOVE_TYPES = frozenset({"charge", "align_with_rack", "to_unload_point"})
"""These drive to a thing, not to a pose: ``/planning_state`` shows ``intent_target_pose`` and no target poses."""
DEPRECATED_MOVE_TYPES = frozenset({"leave_elevator", "pull_over", "parking", "along_central_line"})


Name = Annotated[str, Field(max_length=1000)]


class MoveCreate(Message):
    """A move as a client requests it. Metres, radians, map frame; ``none`` behaves like ``standard``. ``properties``
    are stored and returned as sent.
    """

    creator: Name = "control_unit"
    type: MoveType = "none"
    target_x: float | None = None
    target_y: float | None = None
    target_z: float | None = None
    target_ori: float | None = None
    target_accuracy: Annotated[float, Field(ge=0)] | None = None
    use_target_zone: bool | None = None
    route_coordinates: Annotated[str, Field(max_length=100_000)] | None = None
    detour_tolerance: Annotated[float, Field(ge=0)] | None = None
    charge_retry_count: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    rack_area_id: Name | None = None
    properties: dict[str, Any] = Field(default_factory=dict)


class Move(MoveCreate):
    """A stored move. Times are unix seconds; ``fail_reason`` is a ``MoveFailReason`` number."""

    id: int
    state: MoveState
    fail_reason: int = 0
    fail_message: str = ""
    create_time: int
    last_modified_time: int
    is_charging: bool | None = None


class CreateMove(Message):
    op: Literal["create"] = "create"
    move: MoveCreate


class GetMove(Message):
    """One move by id; without an id, the running one."""

    op: Literal["get"] = "get"
    id: int | None = None


class ListMoves(Message):
    """Newest first; ``offset`` and ``limit`` page, both optional."""

    op: Literal["list"] = "list"
    offset: Annotated[int, Field(ge=0)] = 0
    limit: Annotated[int, Field(ge=1)] | None = None


class CancelMove(Message):
    """Cancel the running move; with an id, only if it is that one."""

    op: Literal["cancel"] = "cancel"
    id: int | None = None


class PauseMove(Message):
    """Hold the running move still until it is resumed, or let it go on; with an id, only if it is that one. Asking for
    what is so already changes nothing."""

    op: Literal["pause"] = "pause"
    id: int | None = None
    paused: bool


class ClearMoves(Message):
    """Forget all moves that have ended. Ids are not used again."""

    op: Literal["clear"] = "clear"


class MoveRequest(Message):
    request: Annotated[
        CreateMove | GetMove | ListMoves | CancelMove | PauseMove | ClearMoves, Field(discriminator="op")
    ]


class MoveReply(Message):
    """``moves`` holds the one move created, got, cancelled, paused or resumed, or a page of a list, or none."""

    moves: tuple[Move, ...] = Field(strict=False)


class PlanningState(Message):
    """State of the current (or last) move; the source of ``/planning_state``.

    ``message``: why the move is held, failed or was cancelled; empty otherwise. ``paused``: by a client, until it is
    resumed. ``target``: the pose to drive to; None for a move with an ``intent_target``, which is the pose of the thing
    it drives to, as a rack or a charger, corrected by what the scan shows of it. ``passed_points``: points of the given
    route that the chassis has passed; kept when the move has ended.
    """

    VERSION: ClassVar[int] = 3

    stamp: Stamp
    map_uid: str = ""
    action_id: int = 0
    action_type: str = "none"
    move_state: Literal["none", "idle", "moving", "succeeded", "failed", "cancelled"] = "none"
    fail_reason: int = 0
    remaining_distance: float = 0.0
    target: Pose2 | None = None
    message: str = ""
    paused: bool = False
    move_intent: str = "none"
    intent_target: Pose2 | None = None
    stuck_state: StuckState = "none"
    viewport_blocked: bool = False
    flags: tuple[PlanningFlag, ...] = Field(default=(), strict=False)
    passed_points: Annotated[int, Field(ge=0)] = 0


class PlannedPath(Message):
    """The path ahead: rows of x, y, yaw in the map frame; empty when no move runs."""

    stamp: Stamp
    poses: Annotated[np.ndarray, Array("<f8", (-1, 3))]


class MoveEvent(Message):
    """Something that happened to a move."""

    stamp: Stamp
    move_id: int
    event: Literal[
        "created",
        "replaced",
        "replanned",
        "blocked",
        "unblocked",
        "paused",
        "resumed",
        "succeeded",
        "failed",
        "cancelled",
    ]
    text: str = ""
