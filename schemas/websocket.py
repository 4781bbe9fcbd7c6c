"""Topics of the gateway's chassis WebSocket (`/ws/v2/topics`): what each one's JSON frame holds.

A frame is ``{"topic": NAME, …fields}``. Fields that have a default are absent from the frame unless they are given.
Units are metres, radians and seconds; poses are in the map frame; times are unix seconds.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

Xy = tuple[float, float]
DEFAULT_RATE = 5.0


class Frame(BaseModel):
    """A value that is sent to or taken from WebSocket clients: finite, and closed to unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class WsTopic(Frame):
    """A topic that clients enable.

    ``RATE``: the most frames a second of wall time; changes of state are not held back. ``LEGACY``: its name on
    ``/ws/topics``. ``REPEATED``: sent again after some seconds without a change, as real robots do. ``LATCHED``: the
    last value is sent as a client enables the topic.
    """

    TOPIC: ClassVar[str]
    RATE: ClassVar[float] = DEFAULT_RATE
    LEGACY: ClassVar[str] = ""
    REPEATED: ClassVar[bool] = False
    LATCHED: ClassVar[bool] = True


class PoseFrame(Frame):
    """A pose: position and heading."""

    pos: Xy
    ori: float


class TrackedPose(WsTopic):
    """where the robot is, with the covariance of its position"""

    TOPIC = "/tracked_pose"
    RATE = 10.0
    LEGACY = "/chassis/pose"

    pos: Xy
    ori: float
    cov: tuple[Xy, Xy]


class SlamState(WsTopic):
    """how well the pose is known: `position_quality` 0 unknown, 1 lost, 3 poor, 8 good, 10 excellent"""

    TOPIC = "/slam/state"
    RATE = 1.0

    state: Literal["inactive", "positioning"]
    reliable: bool
    lidar_reliable: bool
    position_loss_progress: float | None = None
    position_quality: int
    lidar_matching_score: float
    lidar_matched: bool
    wheel_slipping: bool


class MotionMetrics(WsTopic):
    """velocities and acceleration"""

    TOPIC = "/motion_metrics"
    RATE = 10.0

    linear_velocity: float
    linear_acc: float
    angular_velocity: float


class PlanningStateFrame(WsTopic):
    """state of the running or last move: targets, remaining distance, flags, `stuck_state`, fail reason, `message`"""

    TOPIC = "/planning_state"
    REPEATED = True

    map_uid: str
    action_id: int
    action_type: str
    move_state: str
    fail_reason: int
    fail_reason_str: str
    message: str | None = None
    remaining_distance: float
    target_poses: list[PoseFrame]
    charger_pose: PoseFrame
    going_back_to_charger: bool
    move_intent: str
    intent_target_pose: PoseFrame
    stuck_state: str
    given_route_passed_point_count: int
    paused: bool | None = None
    viewport_blocked: bool | None = None
    aligning_with_rack: bool | None = None
    in_elevator: bool | None = None
    is_waiting_for_dest: bool | None = None
    undocking_charger_or_rack: bool | None = None
    unloading_rack: bool | None = None
    waiting_for_charge: bool | None = None


class PathFrame(WsTopic):
    """the path ahead: `positions` are x, y, heading"""

    TOPIC = "/path"
    LEGACY = "/chassis/path"

    stamp: float
    positions: list[tuple[float, float, float]]


class MapFrame(WsTopic):
    """the map in use: `data` is a base64 PNG, `origin` its lower-left corner, `size` in cells"""

    TOPIC = "/map"
    LEGACY = "/chassis/occupancy_grid"

    resolution: float
    size: tuple[int, int]
    origin: Xy
    data: str


class MapFileFrame(WsTopic):
    """the same as `/map`, with the PNG as a file: GET `data_url`, relative to the API's root"""

    TOPIC = "/map_v2"

    stamp: float
    resolution: float
    size: tuple[int, int]
    origin: Xy
    data_url: str


class CostmapFrame(WsTopic):
    """the local costmap as a PNG file: GET `data_url`; 0 free, 200 and more occupied, cells not known are 0"""

    TOPIC = "/map/costmap_v2"
    RATE = 1.0

    stamp: float
    resolution: float
    size: tuple[int, int]
    origin: Xy
    data_url: str


class MapInfo(WsTopic):
    """name, version and overlays (GeoJSON) of the map in use"""

    TOPIC = "/map/info"

    name: str
    uid: str
    map_version: int
    overlays_version: int
    overlays: dict[str, Any]


class BatteryState(WsTopic):
    """charge (0 … 1), voltage, current (negative while charging)"""

    TOPIC = "/battery_state"
    RATE = 1.0

    secs: float
    voltage: float
    current: float
    percentage: float
    power_supply_status: Literal["charging", "discharging", "full"]


class WheelParts(Frame):
    """Control mode and emergency stop."""

    control_mode: str
    emergency_stop_pressed: bool


class WheelState(WsTopic):
    """control mode and emergency stop"""

    TOPIC = "/wheel_state"

    control_mode: str
    emergency_stop_pressed: bool


class ChassisState(WsTopic):
    """the same as `/wheel_state`, for old clients"""

    TOPIC = "/chassis_state"

    control_mode: str
    emergency_stop_pressed: bool
    parts: WheelParts


class AlertRow(Frame):
    """One active alert: code = component · 1000 + n."""

    code: int
    level: Literal["error", "warning", "none"]
    msg: str


class Alerts(WsTopic):
    """all active alerts"""

    TOPIC = "/alerts"

    alerts: list[AlertRow]


class JackState(WsTopic):
    """the jack: `progress` 0 is down, 1 is up"""

    TOPIC = "/jack_state"
    RATE = 2.0

    state: Literal["unknown", "hold", "jacking_up", "jacking_down"]
    progress: float
    self_checking: bool
    self_check_state: Literal["no_error", "up", "down", "error", "unknown"]
    weight: float


class RobotModel(WsTopic):
    """the outline in force (of the body, or of body and carried rack); here x points to the robot's right, y to its
    front
    """

    TOPIC = "/robot_model"
    REPEATED = True

    footprint: list[Xy]
    expanded_footprint: list[Xy]
    width: float


class RobotFootprint(WsTopic):
    """the `footprint` of `/robot_model` alone"""

    TOPIC = "/robot/footprint"

    footprint: list[Xy]


class MatchedPoints(WsTopic):
    """the lidar's hits in the map frame: x, y, z"""

    TOPIC = "/scan_matched_points2"
    RATE = 2.0

    stamp: float
    points: list[tuple[float, float, float]]


# -- sent without being enabled, or as answers -----------------------------------------------------------------------


class Connection(Frame):
    """One WebSocket client."""

    id: int
    username: str
    email: str


class Connections(Frame):
    """all connected clients; sent once after connecting"""

    connections: list[Connection]


class EnabledTopics(Frame):
    """All topics this client has enabled; the answer to `enable_topic` and `disable_topic`. Has no `topic` key."""

    enabled_topics: list[str]


class Empty(Frame):
    """acknowledges one `/twist`"""


class Error(Frame):
    """why a frame of this client was not accepted; nothing has changed"""

    detail: str


# -- taken from clients ------------------------------------------------------------------------------------------------


class ClientFrame(BaseModel):
    """What clients send: strict about the fields it knows, all others are ignored."""

    model_config = ConfigDict(strict=True, extra="ignore", allow_inf_nan=False)


TopicName = Annotated[str, Field(min_length=1, max_length=200)]


class Subscription(ClientFrame):
    """Enable or disable topics, one or a list."""

    enable_topic: TopicName | list[TopicName] = []
    disable_topic: TopicName | list[TopicName] = []


class Twist(ClientFrame):
    """One step of remote driving in m/s and rad/s, left positive; needs control mode `remote`, valid for 500 ms."""

    linear_velocity: float
    angular_velocity: float


class TargetPose(ClientFrame):
    """Where the target is: `pos` and `ori`, or one of them."""

    pos: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    ori: float | None = None


class FollowTargetState(ClientFrame):
    """What the running `follow_target` move follows, 2 to 4 times a second. `follow_pose` has a `target_pose` with
    `pos`, `ori` or both; `pause` holds the robot still; `fail` ends the move with reason 600."""

    follow_state: Literal["follow_pose", "pause", "fail"]
    target_pose: TargetPose | None = None
