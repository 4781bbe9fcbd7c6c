"""What the bus says, as WebSocket clients read it: facts in, JSON payloads out."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS, Pose2
from rackhand.schemas.chassis import Battery, ChassisModel, ChassisStatus, Jack, LocalisedPose, Odometry, Scan
from rackhand.schemas.maps import CurrentMap
from rackhand.schemas.moves import PlannedPath, PlanningState
from rackhand.schemas.world import Clock
from rackhand.services.gateway.chassis_api.models import fail_reason

Payload = dict[str, Any]

FULL_CHARGE = 0.99
RELIABLE_QUALITY = 8
LOST_QUALITY = 1
POSE_LIFE_NS = NANOSECONDS  # a pose older than this, on the clock of odometry, is no longer where the robot is


@dataclass
class Facts:
    """The newest of everything heard from one robot."""

    clock: Clock | None = None
    odometry: Odometry | None = None
    acceleration: float = 0.0
    pose: LocalisedPose | None = None
    scan: Scan | None = None
    scan_pose: Pose2 | None = None
    battery: Battery | None = None
    jack: Jack | None = None
    model: ChassisModel | None = None
    status: ChassisStatus | None = None
    planning: PlanningState | None = None
    path: PlannedPath | None = None
    map: CurrentMap | None = None

    def unix(self, stamp: int) -> float:
        """Unix seconds of a stamp. Without a simulator, stamps are unix nanoseconds themselves."""
        return (stamp + (self.clock.unix_ns if self.clock else 0)) / NANOSECONDS

    @property
    def quality(self) -> int:
        """How well the pose is known, 0 … 10, as in ``LocalisedPose``."""
        if self.pose is None:
            return 0
        if self.odometry is not None and self.odometry.stamp - self.pose.stamp > POSE_LIFE_NS:
            return LOST_QUALITY
        return self.pose.quality


def tracked_pose(facts: Facts) -> Payload | None:
    if facts.pose is None:
        return None
    covariance = facts.pose.covariance[:2, :2].tolist()
    return {**pose_json(facts.pose.pose), "cov": covariance}


def slam_state(facts: Facts) -> Payload:
    quality = facts.quality
    reliable = quality >= RELIABLE_QUALITY
    return {
        "state": "positioning" if facts.map is not None and facts.map.map is not None else "inactive",
        "reliable": reliable,
        "lidar_reliable": reliable,
        **({} if reliable else {"position_loss_progress": 1.0 if quality <= LOST_QUALITY else 0.5}),
        "position_quality": quality,
        "lidar_matching_score": quality / 10,
        "lidar_matched": quality > LOST_QUALITY,
        "wheel_slipping": False,
    }


def motion_metrics(facts: Facts) -> Payload | None:
    if facts.odometry is None:
        return None
    twist = facts.odometry.twist
    return {
        "linear_velocity": twist.linear,
        "linear_acc": facts.acceleration,
        "angular_velocity": twist.angular,
    }


def planning_state(facts: Facts) -> Payload | None:
    """As measured: bools that are false are absent, target poses have three decimals."""
    state = facts.planning
    if state is None:
        return None
    reason = fail_reason(state.fail_reason)
    origin = {"pos": [0, 0], "ori": 0}
    return {
        "map_uid": state.map_uid,
        "action_id": state.action_id,
        "action_type": state.action_type,
        "move_state": state.move_state,
        "fail_reason": state.fail_reason,
        "fail_reason_str": reason.topic_string,
        "remaining_distance": state.remaining_distance,
        "target_poses": [] if state.target is None else [pose_json(state.target, 3)],
        "charger_pose": origin,
        "going_back_to_charger": False,
        "move_intent": state.move_intent,
        "intent_target_pose": origin,
        "stuck_state": state.stuck_state,
        "given_route_passed_point_count": 0,
        **({"viewport_blocked": True} if state.viewport_blocked else {}),
        **({"message": state.message} if state.message else {}),
    }


def path(facts: Facts) -> Payload | None:
    if facts.path is None:
        return None
    return {"stamp": facts.unix(facts.path.stamp), "positions": np.round(facts.path.poses, 4).tolist()}


def occupancy_map(facts: Facts) -> Payload | None:
    """The PNG goes out as it is stored: its row 0 is the top, ``origin`` the lower-left corner."""
    data = facts.map.map if facts.map is not None else None
    if data is None:
        return None
    return {
        "resolution": data.resolution,
        "size": list(png_size(data.png)),
        "origin": list(data.origin),
        "data": base64.b64encode(data.png).decode("ascii"),
    }


def map_info(facts: Facts) -> Payload | None:
    data = facts.map.map if facts.map is not None else None
    if data is None:
        return None
    return {
        "name": data.map_name,
        "uid": data.uid,
        "map_version": data.map_version,
        "overlays_version": data.overlays_version,
        "overlays": data.overlays,
    }


def battery_state(facts: Facts) -> Payload | None:
    battery = facts.battery
    if battery is None:
        return None
    full = battery.charging and battery.percentage >= FULL_CHARGE
    return {
        "secs": facts.unix(battery.stamp),
        "voltage": battery.voltage,
        "current": battery.current,
        "percentage": battery.percentage,
        "power_supply_status": "full" if full else "charging" if battery.charging else "discharging",
    }


def wheel_state(facts: Facts) -> Payload | None:
    if facts.status is None:
        return None
    return {"control_mode": facts.status.control_mode, "emergency_stop_pressed": facts.status.emergency_stop}


def chassis_state(facts: Facts) -> Payload | None:
    wheels = wheel_state(facts)
    return None if wheels is None else {**wheels, "parts": wheels}


def alerts(facts: Facts) -> Payload | None:
    if facts.status is None:
        return None
    return {"alerts": [{"code": row.code, "level": row.level, "msg": row.msg} for row in facts.status.alerts]}


def jack_state(facts: Facts) -> Payload | None:
    if facts.jack is None:
        return None
    return {
        "state": facts.jack.state,
        "progress": facts.jack.progress,
        "self_checking": False,
        "self_check_state": "no_error",
        "weight": facts.jack.weight,
    }


def robot_model(facts: Facts) -> Payload | None:
    if facts.model is None:
        return None
    outline = footprint(facts.model)
    across = [x for x, _ in outline]
    return {"footprint": outline, "expanded_footprint": outline, "width": round(max(across) - min(across), 4)}


def footprint(model: ChassisModel) -> list[list[float]]:
    """The body's corners as this API counts them: x to the robot's right, y to its front."""
    return [[round(float(-y), 4) + 0.0, round(float(x), 4)] for x, y in model.footprint]


def matched_points(facts: Facts) -> Payload | None:
    """The scan's hits in the map frame, seen from the pose of the same instant."""
    if facts.scan is None or facts.scan_pose is None:
        return None
    points = scan_points(facts.scan, facts.scan_pose)
    flat = np.column_stack((points, np.zeros(len(points))))
    return {"stamp": facts.unix(facts.scan.stamp), "points": np.round(flat, 3).tolist()}


def scan_points(scan: Scan, robot: Pose2) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Map-frame hits (n, 2) of a scan taken at pose ``robot``; beams without a return are left out."""
    ranges = scan.ranges.astype(np.float64)
    angles = scan.angle_min + scan.angle_step * np.arange(len(ranges))
    hit = np.isfinite(ranges)
    ranges, angles = ranges[hit], angles[hit] + scan.sensor.yaw
    x = scan.sensor.x + ranges * np.cos(angles)
    y = scan.sensor.y + ranges * np.sin(angles)
    cos, sin = math.cos(robot.yaw), math.sin(robot.yaw)
    return np.column_stack((robot.x + cos * x - sin * y, robot.y + sin * x + cos * y))


def pose_json(pose: Pose2, decimals: int = 4) -> Payload:
    return {"pos": [round(pose.x, decimals), round(pose.y, decimals)], "ori": round(pose.yaw, decimals)}


def png_size(png: bytes) -> tuple[int, int]:
    """Width and height from a PNG's header."""
    return int.from_bytes(png[16:20], "big"), int.from_bytes(png[20:24], "big")


PAYLOADS: dict[str, Callable[[Facts], Payload | None]] = {
    "/tracked_pose": tracked_pose,
    "/slam/state": slam_state,
    "/motion_metrics": motion_metrics,
    "/planning_state": planning_state,
    "/path": path,
    "/map": occupancy_map,
    "/map/info": map_info,
    "/battery_state": battery_state,
    "/wheel_state": wheel_state,
    "/chassis_state": chassis_state,
    "/alerts": alerts,
    "/jack_state": jack_state,
    "/robot_model": robot_model,
    "/scan_matched_points2": matched_points,
}

# Which WebSocket topics a bus topic changes. The scan waits for the pose of its instant.
CHANGED_BY: dict[str, tuple[str, ...]] = {
    topics.POSE.name: ("/tracked_pose", "/slam/state"),
    topics.ODOMETRY.name: ("/motion_metrics",),
    topics.PLANNING_STATE.name: ("/planning_state",),
    topics.PATH.name: ("/path",),
    topics.MAP.name: ("/map", "/map/info", "/slam/state"),
    topics.BATTERY.name: ("/battery_state",),
    topics.CHASSIS_STATUS.name: ("/wheel_state", "/chassis_state", "/alerts"),
    topics.JACK.name: ("/jack_state",),
    topics.CHASSIS_MODEL.name: ("/robot_model",),
}

# The legacy end point's names for the same topics.
LEGACY_NAMES = {
    "/chassis/pose": "/tracked_pose",
    "/chassis/path": "/path",
    "/chassis/occupancy_grid": "/map",
}
