"""A chassis as its driver describes it, for tests of what reads the description."""

from __future__ import annotations

from typing import Any

import numpy as np

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Actuation, ChassisLimits, ChassisModel, JackModel, LidarModel

LIMITS = ChassisLimits(
    forward=1.2, reverse=0.2, angular=1.2, acceleration=0.5, deceleration=2.0, angular_acceleration=1.5
)
LIDAR = LidarModel(
    pose=Pose2(x=0.2, y=0.0, yaw=0.0), height=0.18, beams=720, view=6.283, rate=12.5, range_max=25.0, noise=0.01
)


def chassis_model(
    corners: Any = ((0.375, 0.23), (-0.375, 0.23), (-0.375, -0.23), (0.375, -0.23)), **changes: Any
) -> ChassisModel:
    """A longjack, with ``changes`` to its description. ``corners``: rows x, y of the footprint."""
    fields: dict[str, Any] = {
        "name": "longjack",
        "footprint": np.array(corners, dtype=float),
        "height": 0.245,
        "wheel_separation": 0.38,
        "wheel_radius": 0.075,
        "limits": LIMITS,
        "actuation": Actuation(latency=0.04, lag=0.1),
        "lidar": LIDAR,
        "jack": JackModel(stroke=0.08, duration=11.8, max_load=300.0),
        "charge_contact": "back",
    }
    return ChassisModel(**fields | changes)
