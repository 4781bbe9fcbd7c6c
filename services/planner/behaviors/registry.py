"""Which behaviour carries out which move type. A new move type is a file in this folder and a row here."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors import (
    along_given_route,
    approach,
    charge,
    deprecated,
    enter_elevator,
    follow_target,
    rack_area,
    return_to_elevator_waiting_point,
)
from rackhand.services.planner.behaviors.base import Behavior
from rackhand.services.planner.errors import MoveFailed

Factory = Callable[[MoveCreate], Behavior]
Registry = Mapping[str, Factory]

BEHAVIORS: Registry = {
    "none": approach.for_request,
    "standard": approach.for_request,
    "align_with_rack": rack_area.align_for_request,
    "charge": charge.for_request,
    "to_unload_point": rack_area.unload_for_request,
    "along_given_route": along_given_route.for_request,
    "follow_target": follow_target.for_request,
    "enter_elevator": enter_elevator.for_request,
    "return_to_elevator_waiting_point": return_to_elevator_waiting_point.for_request,
    "leave_elevator": deprecated.for_request,
    "pull_over": deprecated.for_request,
    "parking": deprecated.for_request,
    "along_central_line": deprecated.for_request,
}


def behavior_for(request: MoveCreate, registry: Registry) -> Behavior:
    """Raises ``MoveFailed``: with ``unknown`` for a type of the API that this version cannot carry out."""
    make = registry.get(request.type)
    if make is None:
        raise MoveFailed(MoveFailReason.UNKNOWN, f"moves of type {request.type} are not available in this version")
    return make(request)
