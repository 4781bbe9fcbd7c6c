"""WebSocket topics of sensors and of what is measured, as in ``websocket``."""

from __future__ import annotations

from typing import Literal

from rackhand.schemas.websocket import Frame, WsTopic, Xy


class CostmapPicture(WsTopic):
    """the local costmap: `data` is a base64 PNG, 0 free, 200 and more occupied; `origin` its lower-left corner"""

    TOPIC = "/maps/5cm/1hz"
    RATE = 1.0

    resolution: float
    size: tuple[int, int]
    origin: Xy
    data: str


class LocalPath(WsTopic):
    """the next metres of `/path`, as wide as the robot"""

    TOPIC = "/local_path"

    width: float
    color: str
    poses: list[tuple[float, float, float]]


class Trajectory(WsTopic):
    """where the robot has driven in the running mapping, in the frame of the new map"""

    TOPIC = "/trajectory"
    RATE = 1.0

    points: list[Xy]


class DetailedBatteryState(WsTopic):
    """`/battery_state`, and what is not measured on this chassis as `"nan"`"""

    TOPIC = "/detailed_battery_state"
    RATE = 1.0

    secs: float
    voltage: float
    current: float
    percentage: float
    power_supply_status: Literal["charging", "discharging", "full"]
    cell_voltages: list[float]
    capacity: str
    design_capacity: str
    state_of_health: str
    cycle_count: int


class FusedSensorState(WsTopic):
    """whether the robot is still"""

    TOPIC = "/fused_sensor_state"
    RATE = 1.0

    slipping: bool
    major_slipping: bool
    pushed: bool
    is_still: bool
    odom_still: bool


class SensorManagerState(WsTopic):
    """always awake"""

    TOPIC = "/sensor_manager_state"

    power_state: Literal["awake", "awakening", "sleeping"]


class BumperState(WsTopic):
    """the bumpers"""

    TOPIC = "/bumper_state"

    front_bumper_pressed: bool
    rear_bumper_pressed: bool


class TravelledDistance(WsTopic):
    """metres driven, by odometry, since the gateway knows the robot"""

    TOPIC = "/platform_monitor/travelled_distance"
    RATE = 1.0

    start_time: float
    duration: float
    distance: float
    accumulated_distance: float


class PointField(Frame):
    """A column of points as bytes."""

    name: str
    data_type: Literal["f32"]


class MatchedLaser(WsTopic):
    """the lidar's hits in the map frame: `data` is base64 of little-endian rows of `fields`"""

    TOPIC = "/horizontal_laser_2d/matched"
    RATE = 2.0

    stamp: float
    fields: list[PointField]
    data: str
