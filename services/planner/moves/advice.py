"""What to do about a move that failed or waits, by its reason."""

from __future__ import annotations

from rackhand.schemas.fail_reasons import MoveFailReason as Reason

_ADVICE: dict[Reason, str] = {
    Reason.GET_MAP_FAILED: "select a map with POST /chassis/current-map",
    Reason.STARTING_POINT_OUT_OF_MAP: "select the map of the place where the robot is, or correct its pose",
    Reason.ENDING_POINT_OUT_OF_MAP: "choose a target inside the map",
    Reason.STARTING_POINT_NOT_IN_GROUND: "drive the robot out with /twist in control mode remote, or correct the map",
    Reason.ENDING_POINT_NOT_IN_GROUND: "choose a target with more room, or correct the map or its overlays there",
    Reason.STARTING_EQUAL_ENDING: "give target_ori, or another target",
    Reason.CALCULATION_FAILED: "open the place that is too narrow, or correct the map or its overlays there",
    Reason.CALCULATION_TIMEOUT: "raise the setting planning.search_limit, or choose a nearer target",
    Reason.NO_GLOBAL_PATH: "widen the place where the footprint cannot turn, or choose another target",
    Reason.PLANNING_TIMEOUT: "remove what blocks the way, then post the move again",
    Reason.MOVE_TIMEOUT: "remove what blocks the way, then post the move again; if nothing does, check the wheels",
    Reason.CONTROL_COSTMAP_ERROR: "check the lidar: the driver publishes no usable scan",
    Reason.POWER_CABLE_CONNECTED: "unplug the power cable",
    Reason.ROTATE_TIMEOUT: "make room for the turn; if nothing is in the way, check the wheels",
    Reason.CHARGE_RETRY_COUNT_EXCEEDED: "check that the charger is where the map has it and that its contacts are free",
    Reason.CHARGE_DOCK_DETECTION_ERROR: "check that the charger is where the map has it and that nothing hides it",
    Reason.CHARGE_DOCK_SIGNAL_ERROR: "check that the charger has power",
    Reason.INVALID_CHARGE_DOCK: "register the charger in the overlays of the map (a point of type 9)",
    Reason.ALREADY_IN_CHARGING: "nothing: the robot is charging",
    Reason.NO_CHARGE_CURRENT: "check that the charger has power and that its contacts are clean",
    Reason.INVALID_TRACK_POINTS: "give route_coordinates as x1, y1, x2, y2, … with two points or more",
    Reason.TOO_FAR_FROM_START_OF_TRACK: "drive to the first point of the route first, or begin it where the robot is",
    Reason.INVALID_RACK_DETECTION_POS: "target a rack point of the map, or register one there (a point of type 34)",
    Reason.RACK_DETECTION_ERROR: "check that the rack is there, rack.specs has its size, and nothing hides its legs",
    Reason.RACK_RETRY_COUNT_EXCEEDED: "check that the way under the rack is free and that the rack stands straight",
    Reason.UNLOAD_POINT_OCCUPIED: "clear the place, or choose another one",
    Reason.UNLOAD_POINT_UNREACHABLE: "make room for the robot with its rack, or choose another place",
    Reason.RACK_MOVED: "set the rack down with jack_down, align with it and lift it anew",
    Reason.JACK_IN_UP_STATE: "call jack_down and wait until it has arrived",
    Reason.INVALID_RACK_AREA_ID: "give the id of a rack zone of the map (a polygon of regionType 17)",
    Reason.INVALID_RACK_AREA: "register rack points inside the zone",
    Reason.UNKNOWN_RACK_SPACE_STATE: "make the rack points of the zone visible to the lidar",
    Reason.NO_RACK_IN_RACK_AREA: "put a rack on a point of the zone",
    Reason.ALIGN_FAILED_IN_RACK_AREA: "read the cause of each rack point",
    Reason.NO_FREE_SPACE_IN_RACK_AREA: "clear a point of the zone",
    Reason.FAILED_TO_UNLOAD_IN_RACK_AREA: "read the cause of each rack point",
    Reason.CARGO_READY_NOT_TRIGGERED: "align with a rack and lift it first",
    Reason.FOLLOW_FAILED: "publish /follow_target_state at 2 to 4 Hz while the target is seen",
    Reason.PLATFORM_ALERT_ERROR: "read /alerts, mend what it names, then post the move again",
    Reason.INTERNAL_ERROR: "report it with the planner's log",
    Reason.MAP_CHANGED: "post the move again on the map in use",
    Reason.MOVE_ACTION_TYPE_DEPRECATED: "use another move type",
    Reason.ENDING_POINT_NOT_SPECIFIED: "give target_x and target_y, a place in the lift",
    Reason.CONFIGURATION_ERROR: "choose a place in a lift of the map (a polygon of regionType 3), or draw the lift",
    Reason.ELEVATOR_CLOSED: "call the lift and wait for its door",
    Reason.ELEVATOR_POINT_OCCUPIED: "clear the lift's cabin",
    Reason.ELEVATOR_POINT_OBSCURED_TIMEOUT: "clear the view into the lift's cabin",
    Reason.ELEVATOR_POINT_OCCUPANCY_DETECTION_TIMEOUT: "clear the view into the lift's cabin",
    Reason.ELEVATOR_ENTER_PROGRESS_UPDATE_TIMEOUT: "clear the way into the lift",
}
_WHILE_HELD = (
    ("emergency stop", "release the emergency stop: POST /services/wheel_control/set_emergency_stop"),
    ("paused on request", 'resume it: PATCH /chassis/moves/current {"state": "moving"}'),
    ("set to 0", "raise the setting: PATCH /system/settings/user"),
    ("velocity is set", "raise the setting: PATCH /system/settings/user"),
    ("slow zone", "change the slow zone in the overlays of the map"),
    ("obstacle", "remove what is in the way"),
    ("jack", "wait until the jack has arrived; see /jack_state"),
    ("scan", "check the lidar"),
    ("position", "check the localiser; see /slam/state"),
)


def advice_for(reason: int, text: str) -> str:
    """What to do about a fail reason; without one, about what holds a move, by its text. Empty where nothing helps."""
    if reason:
        try:
            return _ADVICE.get(Reason(reason), "")
        except ValueError:
            return ""
    return next((advice for part, advice in _WHILE_HELD if part in text), "")
