"""The moves of one chassis: which are accepted, which one runs, how they end. One runs at a time; there is no queue."""

from __future__ import annotations

from typing import Literal, Protocol

from rackhand.schemas.base import Pose2
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import DEPRECATED_MOVE_TYPES, Move, MoveCreate
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.plain_json import json_error

TARGET_MISSING = "(target_x target_y) or target_ori must be provided"  # the real robot's words, clients compare them
WITHOUT_TARGET = DEPRECATED_MOVE_TYPES | {"follow_target", "along_given_route", "charge"}
RACK_TYPES = frozenset({"align_with_rack", "to_unload_point"})
EndState = Literal["succeeded", "failed", "cancelled"]


class MoveRecords(Protocol):
    """Where moves are kept, in memory and on disk. None of these waits for the disk; see ``PlannerService``."""

    def add(self, request: MoveCreate, now: int, ended: Move | None) -> Move:
        """Keep a new running move under a new id and, in the same step, the end of the one it replaces."""

    def save(self, move: Move) -> None:
        """Keep the present state of a move."""

    def get(self, move_id: int) -> Move | None:
        """The move of that id."""

    def page(self, offset: int, limit: int | None) -> tuple[Move, ...]:
        """Moves, newest first."""

    def clear(self, but: int | None) -> None:
        """Forget all moves but one."""


def check(request: MoveCreate) -> None:
    """Raises ``RequestRefused`` (invalid) for a move that is not well formed.

    A well-formed but impossible target is none of this function's business: such a move is accepted, and fails.
    """
    _check_target(request)
    if (trouble := json_error(request.properties)) is not None:
        raise RequestRefused(RefusalCode.INVALID, f"properties: {trouble}")
    rotate = request.properties.get("inplace_rotate")
    if rotate is not None and not isinstance(rotate, bool):
        raise RequestRefused(RefusalCode.INVALID, f"properties.inplace_rotate is {rotate!r}, want true or false")
    layer = request.properties.get("rack_layer")
    if layer is not None and (isinstance(layer, bool) or not isinstance(layer, int)):
        raise RequestRefused(RefusalCode.INVALID, f"properties.rack_layer is {layer!r:.60}, want an integer from 0 on")


def _check_target(request: MoveCreate) -> None:
    half_a_point = (request.target_x is None) != (request.target_y is None)
    if half_a_point and request.target_ori is not None:
        raise RequestRefused(RefusalCode.INVALID, "target_x and target_y must be provided together")
    exempt = request.type in WITHOUT_TARGET or (request.type in RACK_TYPES and request.rack_area_id is not None)
    if not exempt and (request.target_x is None or half_a_point) and request.target_ori is None:
        raise RequestRefused(RefusalCode.INVALID, TARGET_MISSING)


class MoveBook:
    """The move that runs, and all before it. Times are unix seconds."""

    def __init__(self, records: MoveRecords) -> None:
        self._records = records
        self.current: Move | None = None
        self.last: Move | None = next(iter(records.page(0, 1)), None)

    def create(self, request: MoveCreate, now: int) -> tuple[Move, Move | None]:
        """Begin a move. Returns it, and the one it replaced (now ``cancelled``), if any ran.

        Raises ``RequestRefused`` for a request that is not well formed; then nothing has changed.
        """
        check(request)
        replaced = (
            None if self.current is None else _ended(self.current, "cancelled", now, text="replaced by a newer move")
        )
        move = self._records.add(request, now, replaced)
        self.current = self.last = move
        return move, replaced

    def end(self, state: EndState, now: int, reason: MoveFailReason = MoveFailReason.NONE, text: str = "") -> Move:
        """End the move that runs. Raises ``LookupError`` when none runs.

        ``failed`` has a reason and a text, ``cancelled`` a text that says why.

        The move is over even if keeping that fails: the store then still says ``moving``, which the next start reads
        as a crash, and closes.
        """
        if self.current is None:
            raise LookupError("no move runs")
        move = _ended(self.current, state, now, reason, text)
        self.current, self.last = None, move
        self._records.save(move)
        return move

    def get(self, move_id: int | None) -> Move:
        """A move by id; without an id, the one that runs. Raises ``RequestRefused`` (not_found)."""
        if move_id is None:
            if self.current is None:
                raise RequestRefused(RefusalCode.NOT_FOUND, "no move is active")
            return self.current
        if self.current is not None and self.current.id == move_id:
            return self.current
        move = self._records.get(move_id)
        if move is None:
            raise RequestRefused(RefusalCode.NOT_FOUND, f"there is no move {move_id}")
        return move

    def page(self, offset: int, limit: int | None) -> tuple[Move, ...]:
        return self._records.page(offset, limit)

    def clear(self) -> None:
        """Forget all moves that have ended; the state of the last one is still published."""
        self._records.clear(None if self.current is None else self.current.id)

    def active(self, move_id: int | None) -> Move:
        """The running move, if it is the one meant. Raises ``RequestRefused`` (not_found, precondition)."""
        move = self.get(move_id)
        if self.current is None or move.id != self.current.id:
            raise RequestRefused(RefusalCode.PRECONDITION, f"move {move.id} is {move.state} and cannot be changed")
        return move


def _ended(move: Move, state: EndState, now: int, reason: MoveFailReason = MoveFailReason.NONE, text: str = "") -> Move:
    # Simulation time restarts at a reset; a record's times never run backwards.
    # Only a charge move says whether it ended in charging: it succeeds when current flows.
    charging = {"is_charging": state == "succeeded"} if move.type == "charge" else {}
    return move.model_copy(
        update={
            **charging,
            "state": state,
            "fail_reason": int(reason),
            "fail_message": text,
            "last_modified_time": max(now, move.last_modified_time),
        }
    )


def target_of(request: MoveCreate) -> Pose2 | None:
    """The target as requested, map frame; None for a move without a position."""
    if request.target_x is None or request.target_y is None:
        return None
    return Pose2(x=request.target_x, y=request.target_y, yaw=request.target_ori or 0.0)
