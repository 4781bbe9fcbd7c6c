"""Why a move fails with each ``MoveFailReason``, in words, and whether a move of this chassis can."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rackhand.schemas.fail_reasons import MoveFailReason as Reason

Met = Literal["move", "device", "unused"]
"""By a ``move`` of a type of the API, with a scenario for it; only with a ``device`` that this chassis has none of; or
never: ``unused``."""


@dataclass(frozen=True)
class Cause:
    """``text``: what the reason is raised for; for ``unused`` ones, why it is never raised."""

    text: str
    met: Met = "move"


CAUSES: dict[Reason, Cause] = {
    Reason.NONE: Cause("the move did not fail", "unused"),
    Reason.UNKNOWN: Cause(
        "a planner that is newer than the gateway gave a reason that the gateway does not know", "unused"
    ),
    Reason.GET_MAP_FAILED: Cause("no map is in use, or it cannot be used"),
    Reason.STARTING_POINT_OUT_OF_MAP: Cause("the robot is outside the map"),
    Reason.ENDING_POINT_OUT_OF_MAP: Cause("the goal is outside the map"),
    Reason.STARTING_POINT_NOT_IN_GROUND: Cause(
        "the robot's footprint overlaps non-traversable cells, or its centre is in one"
    ),
    Reason.ENDING_POINT_NOT_IN_GROUND: Cause("the footprint at the goal overlaps non-traversable cells"),
    Reason.STARTING_EQUAL_ENDING: Cause("a turn on the spot, and neither a place nor a heading to turn to is missing"),
    Reason.CALCULATE_GLOBAL_PATH_EXTENDED_DATA_ERROR: Cause(
        "no step after the search for a path can fail here", "unused"
    ),
    Reason.CALCULATION_FAILED: Cause(
        "no way leads to the goal: the ground between is not connected, or a given line is blocked on the map"
    ),
    Reason.CALCULATION_TIMEOUT: Cause(
        "the search for a path tried as many places as the setting `planning.search_limit` allows and found none; with "
        "the default of 6 million only in a hall of more than about 30 x 30 m, where a way exists for a circle inside "
        "the footprint but none for the footprint"
    ),
    Reason.NO_GLOBAL_PATH: Cause(
        "a way exists for a circle inside the footprint, but none on which the footprint can turn"
    ),
    Reason.NOT_GRAB_START_INDEX_ON_GLOBAL_PATH: Cause("a path begins where the robot is", "unused"),
    Reason.NOT_GRAB_END_INDEX_ON_GLOBAL_PATH: Cause("a path ends at the goal", "unused"),
    Reason.PLANNING_TIMEOUT: Cause("for a minute observed obstacles blocked every way"),
    Reason.MOVE_TIMEOUT: Cause("a path is known, and for a minute the robot made no progress on it"),
    Reason.CONTROL_COSTMAP_ERROR: Cause("no usable scan for some seconds"),
    Reason.POWER_CABLE_CONNECTED: Cause("a charging cable is plugged into the robot"),
    Reason.ROTATE_TIMEOUT: Cause("for half a minute the robot could not finish a turn on the spot"),
    Reason.ENDING_POINT_NOT_SIGNIFICANTLY_CHANGED: Cause("a new move is always planned anew", "unused"),
    Reason.ENDING_POINT_APPROACHING: Cause("a new move is always planned anew", "unused"),
    Reason.ENDING_POINT_NOT_SPECIFIED: Cause("a move into a lift without a target"),
    Reason.CHARGE_RETRY_COUNT_EXCEEDED: Cause("the charging contacts did not meet in any of several attempts"),
    Reason.CHARGE_DOCK_DETECTION_ERROR: Cause("no charger is seen where one is registered"),
    Reason.CHARGE_DOCK_SIGNAL_ERROR: Cause("the charging contacts did not meet in the only attempt"),
    Reason.INVALID_CHARGE_DOCK: Cause("no charger is registered on the map near the target"),
    Reason.ALREADY_IN_CHARGING: Cause("the robot is being charged already"),
    Reason.NO_CHARGE_CURRENT: Cause("the charging contacts meet, and no current flows"),
    Reason.INVALID_CABINET_POS: Cause("a cabinet with a conveyor", "device"),
    Reason.CABINET_DETECTION_ERROR: Cause("a cabinet with a conveyor", "device"),
    Reason.NO_DOCK_WITH_CONVEYER: Cause("a conveyor", "device"),
    Reason.NO_APPROACH_CONVEYER: Cause("a conveyor", "device"),
    Reason.ELEVATOR_POINT_OCCUPIED: Cause(
        "something is where the robot is to stand in the lift, and it makes no progress for 10 s"
    ),
    Reason.ELEVATOR_CLOSED: Cause("the door of the lift was closed for 3 s before the robot was in it"),
    Reason.ELEVATOR_POINT_OBSCURED_TIMEOUT: Cause("for 20 s something hid where the robot is to stand in the lift"),
    Reason.ELEVATOR_POINT_OCCUPANCY_DETECTION_TIMEOUT: Cause(
        "for 10 s the scans did not show where the robot is to stand in the lift"
    ),
    Reason.ELEVATOR_ENTER_PROGRESS_UPDATE_TIMEOUT: Cause(
        "the robot made no progress into the lift for 10 s, and nothing is where it is to stand"
    ),
    Reason.INVALID_TRACK_POINTS: Cause("`route_coordinates` is no list of two points or more"),
    Reason.TOO_FAR_FROM_START_OF_TRACK: Cause("the robot is too far from the first point of the given route"),
    Reason.INVALID_RACK_DETECTION_POS: Cause(
        "the target is at no rack point of the map, or the layer is not one of the rack"
    ),
    Reason.RACK_DETECTION_ERROR: Cause(
        "no rack is recognised: none there, legs not seen, of a size that `rack.specs` has not, or too far "
        "off its point"
    ),
    Reason.RACK_RETRY_COUNT_EXCEEDED: Cause("the robot could not get under the rack in any of its attempts"),
    Reason.UNLOAD_POINT_OCCUPIED: Cause("something is where the rack is to be put down, and stays there for 15 s"),
    Reason.UNLOAD_POINT_UNREACHABLE: Cause("no way for the robot with its rack leads to the unload point"),
    Reason.RACK_MOVED: Cause("the rack has slid far on the jack since it was lifted"),
    Reason.JACK_IN_UP_STATE: Cause(
        "the jack is up when the robot is to drive under a rack, to a charger, or out of one"
    ),
    Reason.INVALID_RACK_AREA_ID: Cause("the map has no rack area of this id"),
    Reason.INVALID_RACK_AREA: Cause("no rack point is in the rack area"),
    Reason.UNKNOWN_RACK_SPACE_STATE: Cause(
        "a rack point of the area cannot be seen, so that nobody knows whether it is free"
    ),
    Reason.NO_RACK_IN_RACK_AREA: Cause("no rack is at any rack point of the area"),
    Reason.ALIGN_FAILED_IN_RACK_AREA: Cause("racks are in the area, and none of them could be driven under"),
    Reason.NO_FREE_SPACE_IN_RACK_AREA: Cause("every rack point of the area is occupied"),
    Reason.FAILED_TO_UNLOAD_IN_RACK_AREA: Cause(
        "a rack point of the area is free, and the rack could not be put down there"
    ),
    Reason.RACK_SUBTYPE_INCOMPATIBLE: Cause("racks of several types of coupling", "device"),
    Reason.TOWING_HOOK_IN_LOCKED_STATE: Cause("a towing hook", "device"),
    Reason.CARGO_READY_LIMIT_SWITCH_FAULT: Cause("a limit switch for the cargo", "device"),
    Reason.CARGO_READY_NOT_TRIGGERED: Cause("a rack is to be put down, and none is on the raised jack"),
    Reason.FOLLOW_FAILED: Cause("the target to follow was reported lost, or not reported for 10 s"),
    Reason.FOLLOW_PATH_TOO_CIRCUITOUS: Cause("a target is followed on any way that leads to it", "unused"),
    Reason.POI_DETECTION_ERROR: Cause("docking to points of interest by camera", "device"),
    Reason.POI_UNREACHABLE: Cause("docking to points of interest by camera", "device"),
    Reason.BARCODE_DETECTION_ERROR: Cause("a camera that reads barcodes", "device"),
    Reason.PLATFORM_ALERT_ERROR: Cause(
        "the robot is not localised, or its driver is gone, or its planner was restarted, or its jack did not arrive"
    ),
    Reason.SERVICE_CALL_ERROR: Cause(
        "a gateway that does not reach the planner answers the request with status 503, and there is no move", "unused"
    ),
    Reason.INTERNAL_ERROR: Cause("an error of the planner itself, which no scenario can cause", "unused"),
    Reason.MAP_CHANGED: Cause("another map was selected, or the map was changed, during the move"),
    Reason.MOVE_ACTION_TYPE_DEPRECATED: Cause("a type of move that is not carried out any more"),
    Reason.CONFIGURATION_ERROR: Cause("the target of a move into a lift is in no lift of the map"),
}
