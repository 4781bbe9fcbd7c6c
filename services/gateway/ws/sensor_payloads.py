"""The frames of the WebSocket topics of sensors, made as in ``payloads``."""

from __future__ import annotations

import base64

import numpy as np

from rackhand.schemas import topics
from rackhand.schemas import websocket_sensors as ws
from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.scan_points import scan_points
from rackhand.services.gateway.ws.facts import Facts
from rackhand.services.gateway.ws.files import grey_png
from rackhand.services.gateway.ws.payloads import battery_state, costmap_grey, payload

NEXT = 3.0  # m of path
COLOUR = "#00FF0080"
STILL = 0.005  # m/s and rad/s
NOT_MEASURED = "nan"


@payload(ws.CostmapPicture)
def costmap_picture(facts: Facts) -> ws.CostmapPicture | None:
    costmap = facts.newest(topics.COSTMAP)
    if costmap is None:
        return None
    grey = costmap_grey(costmap)
    return ws.CostmapPicture(
        resolution=costmap.resolution,
        size=(costmap.columns, len(grey)),
        origin=costmap.origin,
        data=base64.b64encode(grey_png(np.flipud(grey))).decode("ascii"),
    )


@payload(ws.LocalPath)
def local_path(facts: Facts) -> ws.LocalPath | None:
    planned, shape = facts.newest(topics.PATH), facts.newest(topics.FOOTPRINT)
    if planned is None or shape is None:
        return None
    poses = planned.poses
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T) if len(poses) else np.empty(0)
    near = np.concatenate([[0.0], np.cumsum(steps)])[: len(poses)] <= NEXT
    return ws.LocalPath(
        width=round(float(np.ptp(shape.outline[:, 1])), 4), color=COLOUR, poses=np.round(poses[near], 4).tolist()
    )


@payload(ws.Trajectory)
def trajectory(facts: Facts) -> ws.Trajectory | None:
    """Empty while no mapping runs."""
    run = facts.mappings.running
    if run is None:
        return None if facts.matched is None else ws.Trajectory(points=[])
    return ws.Trajectory(points=list(run.trajectory))


@payload(ws.DetailedBatteryState)
def detailed_battery_state(facts: Facts) -> ws.DetailedBatteryState | None:
    battery = battery_state(facts)
    if battery is None:
        return None
    return ws.DetailedBatteryState(
        **battery.model_dump(),
        cell_voltages=[],
        capacity=NOT_MEASURED,
        design_capacity=NOT_MEASURED,
        state_of_health=NOT_MEASURED,
        cycle_count=0,
    )


@payload(ws.FusedSensorState)
def fused_sensor_state(facts: Facts) -> ws.FusedSensorState | None:
    odometry = facts.newest(topics.ODOMETRY)
    if odometry is None:
        return None
    still = max(abs(odometry.twist.linear), abs(odometry.twist.angular)) < STILL
    return ws.FusedSensorState(slipping=False, major_slipping=False, pushed=False, is_still=still, odom_still=still)


@payload(ws.SensorManagerState)
def sensor_manager_state(facts: Facts) -> ws.SensorManagerState | None:
    return None if facts.newest(topics.CHASSIS_STATUS) is None else ws.SensorManagerState(power_state="awake")


@payload(ws.BumperState)
def bumper_state(facts: Facts) -> ws.BumperState | None:
    contacts = facts.newest(topics.CONTACTS)
    if contacts is None:
        return None
    return ws.BumperState(front_bumper_pressed=contacts.bumper_front, rear_bumper_pressed=contacts.bumper_rear)


@payload(ws.TravelledDistance)
def travelled_distance(facts: Facts) -> ws.TravelledDistance | None:
    odometry = facts.newest(topics.ODOMETRY)
    if odometry is None:
        return None
    begun, distance = facts.travelled_since, round(facts.travelled, 3)
    duration = round((odometry.stamp - begun) / NANOSECONDS, 3)
    return ws.TravelledDistance(
        start_time=facts.unix(begun), duration=duration, distance=distance, accumulated_distance=distance
    )


@payload(ws.MatchedLaser)
def matched_laser(facts: Facts) -> ws.MatchedLaser | None:
    if facts.matched is None:
        return None
    scan, pose = facts.matched
    points = scan_points(scan, pose)
    rows = np.column_stack((points, np.zeros(len(points)))).astype("<f4")
    return ws.MatchedLaser(
        stamp=facts.unix(scan.stamp),
        fields=[ws.PointField(name=name, data_type="f32") for name in ("x", "y", "z")],
        data=base64.b64encode(rows.tobytes()).decode("ascii"),
    )
