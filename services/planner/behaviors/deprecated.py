"""Move types of the API that no chassis carries out any more."""

from __future__ import annotations

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.base import Behavior
from rackhand.services.planner.errors import MoveFailed


def for_request(request: MoveCreate) -> Behavior:
    """Raises ``MoveFailed(MOVE_ACTION_TYPE_DEPRECATED)``."""
    raise MoveFailed(MoveFailReason.MOVE_ACTION_TYPE_DEPRECATED, f"moves of type {request.type} are deprecated")
