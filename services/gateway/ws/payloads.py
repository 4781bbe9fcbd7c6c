"""The frames of the WebSocket topics, made of what is known of a robot: facts in, frames out.

Each function makes the topic whose model it is registered for; which bus topics change it says ``schemas/topics.py``.
"""

from __future__ import annotations

import base64
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas import topics
from rackhand.schemas import websocket as ws
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import ChassisStatus, Costmap
from rackhand.schemas.maps import MapData
from rackhand.schemas.scan_points import scan_points
from rackhand.services.gateway.chassis_api.models import fail_reason
from rackhand.services.gateway.ws.facts import LOST_QUALITY, Facts
from rackhand.services.gateway.ws.files import grey_png, png_size

FULL_CHARGE = 0.99
RELIABLE_QUALITY = 8
LETHAL, UNKNOWN = 253, 255  # of a costmap on the bus: from here on the chassis' centre must not be; not observed
HIGHEST_FREE, OCCUPIED = 199, 254  # of a costmap as clients read it

Payload = Callable[[Facts], ws.WsTopic | None]
P = TypeVar("P", bound=Payload)
PAYLOADS: dict[str, Payload] = {}


def payload(view: type[ws.WsTopic]) -> Callable[[P], P]:
    """Registers the function that makes a WebSocket topic. It returns None while there is nothing to send."""

    def register(make: P) -> P:
        PAYLOADS[view.TOPIC] = make
        return make

    return register


def check_complete() -> None:
    """Raises ``LookupError`` for WebSocket topics of the table that no function makes."""
    if missing := [view.TOPIC for view in topics.websocket_topics() if view.TOPIC not in PAYLOADS]:
        raise LookupError(f"no payload function makes {', '.join(missing)}")


@payload(ws.TrackedPose)
def tracked_pose(facts: Facts) -> ws.TrackedPose | None:
    pose = facts.newest(topics.POSE)
    if pose is None:
        return None
    (xx, xy), (yx, yy) = pose.covariance[:2, :2].tolist()
    at = pose_frame(pose.pose)
    return ws.TrackedPose(pos=at.pos, ori=at.ori, cov=((xx, xy), (yx, yy)))


@payload(ws.SlamState)
def slam_state(facts: Facts) -> ws.SlamState:
    quality, current = facts.quality, facts.newest(topics.MAP)
    reliable = quality >= RELIABLE_QUALITY
    loss = {} if reliable else {"position_loss_progress": 1.0 if quality <= LOST_QUALITY else 0.5}
    return ws.SlamState(
        state="positioning" if current is not None and current.map is not None else "inactive",
        reliable=reliable,
        lidar_reliable=reliable,
        position_quality=quality,
        lidar_matching_score=quality / 10,
        lidar_matched=quality > LOST_QUALITY,
        wheel_slipping=False,
        **loss,
    )


@payload(ws.MotionMetrics)
def motion_metrics(facts: Facts) -> ws.MotionMetrics | None:
    odometry = facts.newest(topics.ODOMETRY)
    if odometry is None:
        return None
    twist = odometry.twist
    return ws.MotionMetrics(linear_velocity=twist.linear, linear_acc=facts.acceleration, angular_velocity=twist.angular)


@payload(ws.PlanningStateFrame)
def planning_state(facts: Facts) -> ws.PlanningStateFrame | None:
    """As measured: bools that are false are absent, target poses have three decimals."""
    state = facts.newest(topics.PLANNING_STATE)
    if state is None:
        return None
    origin = ws.PoseFrame(pos=(0, 0), ori=0)
    intent_target = origin if state.intent_target is None else pose_frame(state.intent_target, 3)
    charging = state.action_type == "charge"
    present: dict[str, Any] = dict.fromkeys(state.flags, True)
    present |= {name: True for name in ("paused", "viewport_blocked") if getattr(state, name)}
    if state.message:
        present["message"] = state.message
    return ws.PlanningStateFrame(
        map_uid=state.map_uid,
        action_id=state.action_id,
        action_type=state.action_type,
        move_state=state.move_state,
        fail_reason=state.fail_reason,
        fail_reason_str=fail_reason(state.fail_reason).topic_string,
        remaining_distance=state.remaining_distance,
        target_poses=[] if state.target is None else [pose_frame(state.target, 3)],
        charger_pose=intent_target if charging else origin,
        going_back_to_charger=charging and state.move_state == "moving",
        move_intent="going_back_to_charger" if charging and state.move_state == "moving" else state.move_intent,
        intent_target_pose=intent_target,
        stuck_state=state.stuck_state,
        given_route_passed_point_count=state.passed_points,
        **present,
    )


@payload(ws.PathFrame)
def path(facts: Facts) -> ws.PathFrame | None:
    planned = facts.newest(topics.PATH)
    if planned is None:
        return None
    return ws.PathFrame(stamp=facts.unix(planned.stamp), positions=np.round(planned.poses, 4).tolist())


@payload(ws.MapFrame)
def occupancy_map(facts: Facts) -> ws.MapFrame | None:
    """The PNG goes out as it is stored: its row 0 is the top, ``origin`` the lower-left corner."""
    data = _current_map(facts)
    if data is None:
        return None
    return ws.MapFrame(
        resolution=data.resolution,
        size=png_size(data.png),
        origin=data.origin,
        data=base64.b64encode(data.png).decode("ascii"),
    )


@payload(ws.MapFileFrame)
def map_file(facts: Facts) -> ws.MapFileFrame | None:
    current = facts.newest(topics.MAP)
    if current is None or current.map is None:
        return None
    return ws.MapFileFrame(
        stamp=facts.unix(current.stamp),
        resolution=current.map.resolution,
        size=png_size(current.map.png),
        origin=current.map.origin,
        data_url=facts.files.put("map", current.map.png),
    )


@payload(ws.CostmapFrame)
def costmap_file(facts: Facts) -> ws.CostmapFrame | None:
    costmap = facts.newest(topics.COSTMAP)
    if costmap is None:
        return None
    grey = costmap_grey(costmap)
    return ws.CostmapFrame(
        stamp=facts.unix(costmap.stamp),
        resolution=costmap.resolution,
        size=(costmap.columns, len(grey)),
        origin=costmap.origin,
        data_url=facts.files.put("costmap", grey_png(np.flipud(grey))),
    )


@payload(ws.MapInfo)
def map_info(facts: Facts) -> ws.MapInfo | None:
    data = _current_map(facts)
    if data is None:
        return None
    return ws.MapInfo(
        name=data.map_name,
        uid=data.uid,
        map_version=data.map_version,
        overlays_version=data.overlays_version,
        overlays=data.overlays,
    )


@payload(ws.BatteryState)
def battery_state(facts: Facts) -> ws.BatteryState | None:
    battery = facts.newest(topics.BATTERY)
    if battery is None:
        return None
    full = battery.charging and battery.percentage >= FULL_CHARGE
    return ws.BatteryState(
        secs=facts.unix(battery.stamp),
        voltage=battery.voltage,
        current=battery.current,
        percentage=battery.percentage,
        power_supply_status="full" if full else "charging" if battery.charging else "discharging",
    )


@payload(ws.WheelState)
def wheel_state(facts: Facts) -> ws.WheelState | None:
    status = facts.newest(topics.CHASSIS_STATUS)
    if status is None:
        return None
    return ws.WheelState(control_mode=status.control_mode, emergency_stop_pressed=status.emergency_stop)


@payload(ws.ChassisState)
def chassis_state(facts: Facts) -> ws.ChassisState | None:
    wheels = wheel_state(facts)
    if wheels is None:
        return None
    fields = wheels.model_dump()
    return ws.ChassisState(**fields, parts=ws.WheelParts(**fields))


@payload(ws.Alerts)
def alerts(facts: Facts) -> ws.Alerts | None:
    status = facts.newest(topics.CHASSIS_STATUS)
    if status is None:
        return None
    return ws.Alerts(alerts=[ws.AlertRow(code=row.code, level=row.level, msg=row.msg) for row in status.alerts])


@payload(ws.JackState)
def jack_state(facts: Facts) -> ws.JackState | None:
    jack = facts.newest(topics.JACK)
    if jack is None:
        return None
    status = facts.newest(topics.CHASSIS_STATUS) or ChassisStatus(stamp=0)
    return ws.JackState(
        state=jack.state,
        progress=jack.progress,
        self_checking=status.jack_checking,
        self_check_state=status.jack_check,
        weight=jack.weight,
    )


@payload(ws.RobotModel)
def robot_model(facts: Facts) -> ws.RobotModel | None:
    shape = facts.newest(topics.FOOTPRINT)
    if shape is None:
        return None
    outline = footprint(shape.outline)
    across = [x for x, _ in outline]
    return ws.RobotModel(
        footprint=outline, expanded_footprint=footprint(shape.expanded), width=round(max(across) - min(across), 4)
    )


@payload(ws.RobotFootprint)
def robot_footprint(facts: Facts) -> ws.RobotFootprint | None:
    shape = facts.newest(topics.FOOTPRINT)
    return None if shape is None else ws.RobotFootprint(footprint=footprint(shape.outline))


@payload(ws.MatchedPoints)
def matched_points(facts: Facts) -> ws.MatchedPoints | None:
    """The scan's hits in the map frame, from the pose at which it was taken."""
    if facts.matched is None:
        return None
    scan, pose = facts.matched
    points = scan_points(scan, pose)
    flat = np.column_stack((points, np.zeros(len(points))))
    return ws.MatchedPoints(stamp=facts.unix(scan.stamp), points=np.round(flat, 3).tolist())


def costmap_grey(costmap: Costmap) -> NDArray[np.uint8]:
    """A costmap as clients read it, (rows, columns), row 0 at the bottom."""
    cost = costmap.cost.reshape(-1, costmap.columns)
    grey: NDArray[np.uint8] = (cost.astype(np.uint16) * HIGHEST_FREE // LETHAL).astype(np.uint8)
    grey[cost >= LETHAL] = OCCUPIED
    grey[cost == UNKNOWN] = 0
    return grey


def footprint(outline: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Corners (n, 2) of the chassis frame in this API's frame: x to the robot's right, y to its front."""
    return [(round(float(-y), 4) + 0.0, round(float(x), 4)) for x, y in outline]


def pose_frame(pose: Pose2, decimals: int = 4) -> ws.PoseFrame:
    return ws.PoseFrame(pos=(round(pose.x, decimals), round(pose.y, decimals)), ori=round(pose.yaw, decimals))


def _current_map(facts: Facts) -> MapData | None:
    current = facts.newest(topics.MAP)
    return current.map if current is not None else None
