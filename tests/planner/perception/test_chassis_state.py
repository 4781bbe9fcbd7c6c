from __future__ import annotations

import numpy as np
import pytest

from rackhand.schemas.base import NANOSECONDS, Pose2, Twist2
from rackhand.schemas.chassis import ChassisModel, LocalisedPose, Odometry, RemoteTwist
from rackhand.services.planner.perception.chassis_state import POSE_TIMEOUT_NS, QUALITY_LOST, ChassisState
from tests.chassis_models import chassis_model

HERE = Pose2(x=1.0, y=2.0, yaw=0.3)


def odometry(stamp: int) -> Odometry:
    pose, twist = Pose2(x=9.0, y=9.0, yaw=0.0), Twist2(linear=0.4, angular=0.1)
    return Odometry(stamp=stamp, pose=pose, twist=twist, wheel_velocities=(5.0, 6.0))


def localised(stamp: int, quality: int = 10) -> LocalisedPose:
    return LocalisedPose(stamp=stamp, pose=HERE, covariance=np.eye(3), quality=quality)


def state(*messages: object) -> ChassisState:
    found = ChassisState()
    assert all(found.take(message) for message in messages)  # type: ignore[arg-type]
    return found


def test_an_observation_needs_odometry_and_a_pose() -> None:
    assert state(odometry(5)).observation() is None and state(localised(5)).observation() is None
    seen = state(odometry(7), localised(5)).observation()
    assert seen is not None and (seen.stamp, seen.pose_stamp, seen.pose, seen.scan) == (7, 5, HERE, None)
    assert seen.twist == Twist2(linear=0.4, angular=0.1)


def test_other_messages_are_not_kept() -> None:
    assert not ChassisState().take(RemoteTwist(twist=Twist2(linear=0.0, angular=0.0)))


def test_a_reset_keeps_the_model_alone() -> None:
    model = chassis_model()
    assert isinstance(model, ChassisModel)
    found = state(model, odometry(7), localised(5))
    found.forget()
    assert found.model is model and found.observation() is None


@pytest.mark.parametrize(
    ("messages", "text"),
    [
        ((), "driver"),
        ((odometry(5),), "no localised pose"),
        ((odometry(5), localised(5, QUALITY_LOST)), "lost"),
        ((odometry(POSE_TIMEOUT_NS + NANOSECONDS), localised(0)), "1.5 s old"),
        ((odometry(POSE_TIMEOUT_NS), localised(0)), None),
    ],
)
def test_why_the_pose_is_not_known(messages: tuple, text: str | None) -> None:
    trouble = state(*messages).pose_trouble()
    assert trouble is None if text is None else trouble is not None and text in trouble
