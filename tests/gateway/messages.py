"""Messages of one robot, as they arrive from the bus."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.chassis import (
    Battery,
    ChassisFootprint,
    ChassisModel,
    ChassisStatus,
    Costmap,
    Jack,
    LocalisedPose,
    Odometry,
    Scan,
)
from rackhand.schemas.lift import LiftFloor, LiftModel, LiftState
from rackhand.schemas.maps import CurrentMap, MapData
from rackhand.schemas.moves import PlannedPath, PlanningState
from rackhand.schemas.racks import (
    DetectedRack,
    LoadReport,
    RackLevel,
    RackPoint,
    RackSpec,
    RackStates,
    SeenRack,
    SeenRacks,
)
from rackhand.schemas.world import Clock
from tests.chassis_models import chassis_model
from tests.gateway.harness import grey_png

SECOND = 1_000_000_000


def pose(stamp: int = 0, x: float = 1.0, y: float = 2.0, yaw: float = 0.5, quality: int = 10) -> LocalisedPose:
    return LocalisedPose(stamp=stamp, pose=Pose2(x=x, y=y, yaw=yaw), covariance=np.eye(3) * 0.01, quality=quality)


def odometry(stamp: int = 0, linear: float = 0.0, angular: float = 0.0) -> Odometry:
    twist = Twist2(linear=linear, angular=angular)
    return Odometry(stamp=stamp, pose=Pose2(x=0, y=0, yaw=0), twist=twist, wheel_velocities=(0.0, 0.0))


def planning(**changes: Any) -> PlanningState:
    fields: dict[str, Any] = {
        "stamp": 0,
        "map_uid": "hall",
        "action_id": 7,
        "action_type": "standard",
        "move_state": "moving",
        "remaining_distance": 2.875,
        "target": Pose2(x=4.08004, y=2.99, yaw=0.0),
    }
    return PlanningState(**fields | changes)


def scan(stamp: int = 0, left: float = math.nan) -> Scan:
    """Ahead at 2 m, nothing to the left, behind at 1 m, seen by a lidar 0.1 m in front of the centre. With ``left``,
    only a hit at that distance to the left.
    """
    return Scan(
        stamp=stamp,
        sensor=Pose2(x=0.1, y=0.0, yaw=0.0),
        angle_min=0.0,
        angle_step=math.pi / 2,
        range_max=10.0,
        ranges=np.array([2.0, math.nan, 1.0] if math.isnan(left) else [math.nan, left, math.nan], "<f4"),
    )


def status(**changes: Any) -> ChassisStatus:
    return ChassisStatus(**{"stamp": 0} | changes)


def current_map(
    stamp: int = 0, png: bytes | None = None, name: str = "Hall", features: Sequence[dict[str, Any]] = ()
) -> CurrentMap:
    return CurrentMap(
        stamp=stamp,
        map=MapData(
            id=3,
            uid="hall",
            map_name=name,
            create_time=5,
            last_modified_time=6,
            map_version=1,
            overlays_version=2,
            png=grey_png(4, 3) if png is None else png,
            origin=(-1.0, -2.0),
            resolution=0.05,
            overlays={"type": "FeatureCollection", "features": list(features)},
        ),
    )


def battery(**changes: Any) -> Battery:
    fields: dict[str, Any] = {"stamp": 0, "percentage": 0.8, "voltage": 25.0, "current": 2.0, "charging": False}
    return Battery(**fields | changes)


def jack(state: Any = "hold", progress: float = 0.0, stamp: int = 0) -> Jack:
    return Jack(stamp=stamp, state=state, progress=progress, weight=0.0)


def model(half_width: float = 0.2) -> ChassisModel:
    """0.6 m long (0.4 m of it in front), 0.4 m wide."""
    corners = [[-0.2, -half_width], [0.4, -half_width], [0.4, half_width], [-0.2, half_width]]
    return chassis_model(corners, wheel_separation=0.35, wheel_radius=0.08)


def footprint(half_width: float = 0.2) -> ChassisFootprint:
    """That of ``model``, expanded by 1 cm."""
    outline = model(half_width).footprint
    return ChassisFootprint(stamp=0, outline=outline, expanded=outline + 0.01 * np.sign(outline))


RACK = RackSpec(width=0.9, depth=1.2, margin=(0.1, 0.2, 0.05, 0.05))


def load(state: Any = "carrying", rack_pose: Pose2 | None = None) -> LoadReport:
    """A rack 0.5 m before the chassis' origin, turned to the left."""
    at = rack_pose or Pose2(x=0.5, y=0.0, yaw=math.pi / 2)
    return LoadReport(stamp=0, state=state, spec=RACK, rack_pose=at)


def detected_rack(detected: bool = True, width: float = 0.91) -> DetectedRack:
    if not detected:
        return DetectedRack(stamp=0, detected=False)
    legs = np.array([[3.4, 2.0], [3.4, 2.8], [4.5, 2.8], [4.5, 2.0]])
    at = Pose2(x=4.0, y=2.4, yaw=0.02)
    staging = Pose2(x=2.5, y=2.4, yaw=0.02)
    return DetectedRack(stamp=0, detected=True, pose=at, width=width, depth=1.19, legs=legs, staging=staging)


def rack_states(state: Any = "occupied", stamp: int = SECOND) -> RackStates:
    level = RackLevel(stamp=stamp, state=state)
    return RackStates(stamp=stamp, map_uid="hall", racks=(RackPoint(poi_id="storage-1", levels=(level,)),))


def seen_racks(*poses: Pose2) -> SeenRacks:
    racks = tuple(SeenRack(stamp=0, pose=pose, spec=RACK) for pose in poses)
    return SeenRacks(stamp=0, racks=racks)


def lift(floor: str = "floor1", **fields: Any) -> LiftState:
    return LiftState(**{"stamp": 0, "floor": floor, "door": "open", "opening": 1.0, "holder": "fleet"} | fields)


def lift_model() -> LiftModel:
    """Two floors, 20 m apart; the door is at +x."""
    floors = [LiftFloor(name=f"floor{n}", map=f"hall{n}", pose=Pose2(x=20.0 * n, y=1.0, yaw=0.0)) for n in (1, 2)]
    return LiftModel(floors=tuple(floors), depth=2.3, width=2.6, door_width=1.4, door_at=1.2)


def costmap(columns: int = 3) -> Costmap:
    """Six cells."""
    cost = np.array([0, 1, 252, 253, 254, 255], np.uint8)
    return Costmap(stamp=0, origin=(2.0, 3.0), resolution=0.05, columns=columns, cost=cost)


def path(stamp: int = 0) -> PlannedPath:
    return PlannedPath(stamp=stamp, poses=np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.25]]))


def clock(unix_seconds: int = 1_700_000_000) -> Clock:
    return Clock(
        stamp=0,
        run="one",
        step_ns=20_000_000,
        speed=1.0,
        paused=False,
        lockstep=False,
        unix_ns=unix_seconds * SECOND,
    )
