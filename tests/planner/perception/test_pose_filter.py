from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.schemas.base import Pose2, Twist2
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.perception.chassis_state import Observation
from rackhand.services.planner.perception.pose_filter import PoseFilter
from rackhand.services.planner.settings import PoseNoise

TICK = 40_000_000
NOISE = (0.01, 0.01, 0.005)


def seen(stamp: int, pose: np.ndarray, odometry: np.ndarray, pose_stamp: int | None = None) -> Observation:
    def as_message(p: np.ndarray) -> Pose2:
        return Pose2(x=float(p[0]), y=float(p[1]), yaw=float(p[2]))

    still = Twist2(linear=0.0, angular=0.0)
    return Observation(
        stamp, as_message(pose), stamp if pose_stamp is None else pose_stamp, as_message(odometry), still, None
    )


@pytest.mark.parametrize("turning", [0.0, 0.4])
def test_filters_noise_while_driving(turning: float) -> None:
    random = np.random.default_rng(3)
    true, odometry = np.array([2.0, 3.0, 1.0]), np.array([50.0, -40.0, 2.0])
    pose_filter, errors = PoseFilter(PoseNoise()), []
    for k in range(500):
        pose_filter.update(seen(k * TICK, true + random.normal(0, NOISE), odometry))
        if k > 50:
            errors.append(se2.between(true, pose_filter.pose))
        true = se2.compose(true, np.array([0.04, 0.0, turning * 0.04]))
        odometry = se2.compose(odometry, np.array([0.04 * 1.002, 0.0, turning * 0.04 * 1.002]))
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert (rms[:2] < 0.006).all() and rms[2] < 0.003


def test_a_late_pose_is_moved_on_by_odometry() -> None:
    pose_filter, true = PoseFilter(PoseNoise()), np.zeros(3)
    past = [true]
    for k in range(100):
        measured = past[max(k - 3, 0)]
        pose_filter.update(seen(k * TICK, measured, true, max(k - 3, 0) * TICK))
        assert pose_filter.pose == pytest.approx(true, abs=1e-3)
        assert pose_filter.at(max(k - 5, 0) * TICK) == pytest.approx(past[max(k - 5, 0)], abs=1e-3)
        true = se2.compose(true, np.array([0.04, 0.0, 0.02]))
        past.append(true)


def test_one_wild_pose_does_no_harm_and_a_new_place_is_taken() -> None:
    pose_filter, here = PoseFilter(PoseNoise()), np.array([1.0, 1.0, 0.0])
    for k in range(50):
        pose_filter.update(seen(k * TICK, here, np.zeros(3)))
    pose_filter.update(seen(50 * TICK, here + np.array([5.0, 0.0, 0.0]), np.zeros(3)))
    assert math.hypot(*(pose_filter.pose - here)[:2]) < 1.0
    there = here + np.array([5.0, 0.0, 1.0])
    for k in range(51, 60):
        pose_filter.update(seen(k * TICK, there, np.zeros(3)))
    assert pose_filter.pose == pytest.approx(there, abs=0.02)


def test_a_clock_that_is_reset_is_reset() -> None:
    pose_filter = PoseFilter(PoseNoise())
    pose_filter.update(seen(10**9, np.array([1.0, 2.0, 0.0]), np.array([9.0, 9.0, 0.0])))
    pose_filter.update(seen(0, np.array([4.0, 5.0, 0.0]), np.zeros(3)))
    assert pose_filter.pose == pytest.approx([4.0, 5.0, 0.0])


@pytest.mark.parametrize("seed", range(20))
def test_compose_and_between_are_inverse(seed: int) -> None:
    a, b = np.random.default_rng(seed).uniform(-3, 3, (2, 3))
    assert se2.compose(a, se2.between(a, b)) == pytest.approx(b)


@pytest.mark.parametrize(
    "jump", [(0.0, 0.0, 0.1), (0.1, 0.0, 0.0), (0.07, -0.07, 0.15), (0.24, 0.0, 0.0), (0.0, 0.0, 3.0)]
)
@pytest.mark.parametrize("period", [1, 2, 5, 25])
def test_poses_that_jump_again_and_again_are_followed(jump: tuple[float, float, float], period: int) -> None:
    pose_filter, here, sign = PoseFilter(PoseNoise()), np.zeros(3), 1.0
    odometry = np.zeros(3)
    for k in range(3000):
        if k % period == 0:
            here = here + sign * np.array(jump)
            sign = -sign
        odometry = se2.compose(odometry, np.array([0.04, 0.0, 0.01]))
        here = se2.compose(here, np.array([0.04, 0.0, 0.01]))
        pose_filter.update(seen(k * TICK, here, odometry))
        covariance = pose_filter.covariance
        assert np.array_equal(covariance, covariance.T) and np.linalg.eigvalsh(covariance).min() > 0.0
    for k in range(3000, 3060):
        pose_filter.update(seen(k * TICK, here, odometry))
    assert np.abs(se2.between(here, pose_filter.pose)).max() < 0.01


@pytest.mark.parametrize("size", [1e6, 1e17, 1e308, 1.7e308])
@pytest.mark.parametrize("what", ["pose", "odometry", "both"])
def test_numbers_at_the_ends_of_their_type_do_no_lasting_harm(size: float, what: str) -> None:
    pose_filter, here, k = PoseFilter(PoseNoise()), np.array([1.0, 2.0, 0.5]), 0
    for wild in (True, False, True, True, True, True, False, False):
        far = np.array([size, -size, 0.0]) if wild else np.zeros(3)
        for _ in range(5):
            pose = here + far * (what != "odometry")
            odometry = far * (what != "pose")
            pose_filter.update(seen(k * TICK, pose, odometry))
            assert np.isfinite(pose_filter.pose).all() and np.isfinite(pose_filter.covariance).all()
            k += 1
    assert pose_filter.pose == pytest.approx(here, abs=1e-6)


def test_a_push_is_followed_within_a_few_poses() -> None:
    pose_filter, here = PoseFilter(PoseNoise()), np.zeros(3)
    for k in range(100):
        pose_filter.update(seen(k * TICK, here, np.zeros(3)))
    pushed = np.array([0.2, -0.1, 0.1])
    for k in range(100, 110):
        pose_filter.update(seen(k * TICK, pushed, np.zeros(3)))
    assert pose_filter.pose == pytest.approx(pushed, abs=0.02)
