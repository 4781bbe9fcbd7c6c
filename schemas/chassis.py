"""Measurements, commands and requests of a chassis: the driver interface of a real robot, and of the simulator."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rackhand.schemas.base import Array, Message, Pose2, Stamp, Twist2, Vec2, Vec3

ControlMode = Literal["auto", "manual", "remote"]
CheckState = Literal["no_error", "up", "down", "error", "unknown"]
Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]


class Odometry(Message):
    """Wheel odometry: pose in the odometry frame, body twist, wheel speeds in rad/s (left, right).

    Published last of the measurements of a control step: a subscriber that has it has the others too.
    """

    stamp: Stamp
    pose: Pose2
    twist: Twist2
    wheel_velocities: Vec2


class Scan(Message):
    """A 2-D lidar scan; beam i points at angle_min + i·angle_step.

    Ranges in metres: inf where nothing within ``range_max`` returned (that beam is free), NaN where the lidar has no
    measurement (nothing is known). ``sensor`` is the lidar's pose in the chassis frame.
    """

    stamp: Stamp
    sensor: Pose2
    angle_min: float
    angle_step: Annotated[float, Field(gt=0)]
    range_max: Annotated[float, Field(gt=0)]
    ranges: Annotated[np.ndarray, Array("<f4", (-1,), finite=False)]


class Imu(Message):
    """Angular velocity in rad/s and specific force in m/s², both in the chassis frame."""

    stamp: Stamp
    angular_velocity: Vec3
    linear_acceleration: Vec3


class Jack(Message):
    """The jack: progress 0 is down, 1 is up; weight in kg as its sensor reads it.

    ``stalled``: it has to move up, but what is on it is too heavy for its motor.
    """

    stamp: Stamp
    state: Literal["unknown", "hold", "jacking_up", "jacking_down"]
    progress: Annotated[float, Field(ge=0, le=1)]
    weight: float
    stalled: bool = False


class Battery(Message):
    """Charge 0 … 1, volts, amperes (negative while charging)."""

    stamp: Stamp
    percentage: Annotated[float, Field(ge=0, le=1)]
    voltage: float
    current: float
    charging: bool


class Contacts(Message):
    """The chassis' switches: bumpers, charging contacts, a plugged cable, the emergency-stop button."""

    stamp: Stamp
    bumper_front: bool = False
    bumper_rear: bool = False
    charge_contact: bool = False
    power_cable: bool = False
    emergency_stop_button: bool = False


class LocalisedPose(Message):
    """The pose in the map as a localiser knows it; covariance of (x, y, yaw), row by row."""

    stamp: Stamp
    pose: Pose2
    covariance: Annotated[np.ndarray, Array("<f8", (3, 3))]
    quality: Annotated[int, Field(ge=0, le=10, description="0 unknown, 1 lost, 3 poor, 8 good, 10 excellent")]


class ChassisCommand(Message):
    """Command of the planner to the driver. ``answers`` is the stamp of the odometry it was computed from."""

    answers: Stamp
    twist: Twist2
    jack: Literal["hold", "up", "down"] = "hold"


class ChassisLimits(Message):
    """What may be commanded of a chassis: speeds in m/s and rad/s, accelerations in m/s² and rad/s². All are
    magnitudes; ``reverse`` is 0 for a chassis that must not drive backward.
    """

    forward: Positive
    reverse: NonNegative
    angular: Positive
    acceleration: Positive
    deceleration: Positive
    angular_acceleration: Positive


class Actuation(Message):
    """How a chassis follows a command: a dead time, then a first-order lag, both in seconds."""

    latency: NonNegative = 0.0
    lag: Positive


class LidarModel(Message):
    """The 2-D lidar: ``pose`` in the chassis frame at ``height`` (m) above the floor, ``beams`` over ``view`` (rad),
    ``rate`` in scans a second, ``range_max`` in metres, ``noise`` as 1σ of a range in metres.
    """

    pose: Pose2
    height: Positive
    beams: Annotated[int, Field(gt=1)]
    view: Positive
    rate: Positive
    range_max: Positive
    noise: NonNegative


class JackModel(Message):
    """The jack: ``stroke`` in metres, ``duration`` of a whole stroke in seconds, ``max_load`` in kg."""

    stroke: Positive
    duration: Positive
    max_load: Positive


class ChassisModel(Message):
    """What a chassis is, as its driver describes it: latched, published once and again when it changes.

    ``footprint`` is the outline that must not touch anything: a convex polygon, rows x, y in metres, counter-clockwise
    in the chassis frame (x forward, origin on the floor midway between the driven wheels). ``height`` in metres, with
    the jack down. ``charge_contact``: the side that docks at a charger.
    """

    VERSION: ClassVar[int] = 2

    name: str
    footprint: Annotated[np.ndarray, Array("<f8", (-1, 2))]
    height: Positive
    wheel_separation: Positive
    wheel_radius: Positive
    limits: ChassisLimits
    actuation: Actuation
    lidar: LidarModel
    jack: JackModel | None = None
    charge_contact: Literal["none", "front", "back"] = "none"

    @property
    def width(self) -> float:
        """Extent from side to side in metres."""
        return float(np.ptp(self.footprint[:, 1])) if len(self.footprint) else 0.0

    @property
    def thickness(self) -> float:
        """Extent from back to front in metres; the chassis API calls it so."""
        return float(np.ptp(self.footprint[:, 0])) if len(self.footprint) else 0.0


class Costmap(Message):
    """What the planner steers by nearby: cells row by row from the lower-left corner ``origin`` (map frame).

    0 is free with room to spare, 1 … 252 the dearer the closer to something, 253 too close for the chassis' middle,
    254 blocked, 255 unknown. ``resolution`` in metres a cell.
    """

    stamp: Stamp
    origin: Vec2
    resolution: Annotated[float, Field(gt=0)]
    columns: Annotated[int, Field(gt=0)]
    cost: Annotated[np.ndarray, Array("|u1", (-1,))]

    @model_validator(mode="after")
    def _whole_rows(self) -> Self:
        if self.cost.size % self.columns:
            raise ValueError(f"{self.cost.size} cells are not a multiple of {self.columns} columns")
        return self


class Alert(Message):
    """One row of ``/alerts``: code = component·1000 + n."""

    code: int
    level: Literal["error", "warning", "none"]
    msg: str


class ChassisStatus(Message):
    """Modes and stops of a chassis as the planner, who decides them, holds them.

    ``jack_check``: the stage of a self-check of the jack while ``jack_checking``, else the result of the last one.
    """

    VERSION: ClassVar[int] = 2

    stamp: Stamp
    control_mode: ControlMode = "auto"
    emergency_stop: bool = False
    driver_alive: bool = True
    jack_checking: bool = False
    jack_check: CheckState = "no_error"
    alerts: tuple[Alert, ...] = Field(default=(), strict=False)


class ChassisFootprint(Message):
    """The outline that must not touch anything now: that of the body, or while a rack is carried the convex hull of
    body and rack with its margins.

    Convex polygons, rows x, y in metres, counter-clockwise in the chassis frame. ``expanded``: moved outward by the
    setting ``robot.footprint_expansion``.
    """

    stamp: Stamp
    outline: Annotated[np.ndarray, Array("<f8", (-1, 2))]
    expanded: Annotated[np.ndarray, Array("<f8", (-1, 2))]


class JackRequest(Message):
    op: Literal["jack"] = "jack"
    direction: Literal["up", "down"]


class JackSelfCheck(Message):
    """Move the jack up and down without a load, to find out whether it works."""

    op: Literal["jack_self_check"] = "jack_self_check"


class ClearJackErrors(Message):
    op: Literal["clear_jack_errors"] = "clear_jack_errors"


class DetectRacks(Message):
    """Search the scan for a rack in front of the chassis while no move runs, and measure it; until it is disabled."""

    op: Literal["detect_racks"] = "detect_racks"
    enable: bool


class SetControlMode(Message):
    op: Literal["set_control_mode"] = "set_control_mode"
    control_mode: ControlMode


class SetEmergencyStop(Message):
    op: Literal["set_emergency_stop"] = "set_emergency_stop"
    enable: bool


class RemoteTwist(Message):
    """One step of remote driving; dies 500 ms of chassis time after it was taken. Needs control mode ``remote``."""

    op: Literal["remote_twist"] = "remote_twist"
    twist: Twist2


class SetPose(Message):
    """Tell the localiser where the robot is."""

    op: Literal["set_pose"] = "set_pose"
    pose: Pose2


class FollowTarget(Message):
    """Where the target of the running ``follow_target`` move is, in metres and radians of the map frame.

    ``follow_pose`` needs a position, a heading, or both; ``pause``: hold still; ``fail``: the target is lost.
    """

    op: Literal["follow_target"] = "follow_target"
    state: Literal["follow_pose", "pause", "fail"]
    position: Vec2 | None = None
    yaw: float | None = None

    @model_validator(mode="after")
    def _has_a_target(self) -> Self:
        if self.state == "follow_pose" and self.position is None and self.yaw is None:
            raise ValueError("follow_pose needs a position, a heading, or both")
        return self


class ChassisRequest(Message):
    """A question to, or an order for, the planner about its chassis."""

    request: Annotated[
        JackRequest
        | JackSelfCheck
        | ClearJackErrors
        | DetectRacks
        | SetControlMode
        | SetEmergencyStop
        | RemoteTwist
        | FollowTarget
        | SetPose,
        Field(discriminator="op"),
    ]


class Done(Message):
    """The answer to a request that returns no data."""

    detail: str = ""
