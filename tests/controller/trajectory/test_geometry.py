from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.geometry import (
    Tolerance,
    joint_path,
    pose_step,
    rotation_exp,
    rotation_log,
    task_path,
)
from rackhand.services.controller.trajectory.model import TcpPose

TOLERANCE = Tolerance(joint=0.05, position=0.01, angle=0.05)
SEEDS = st.integers(0, 10_000)


def joints(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(rng.integers(2, 8), 6)) * rng.choice([0.02, 0.3, 2.0])


def poses(seed: int) -> list[TcpPose]:
    rng = np.random.default_rng(seed)
    size = rng.choice([0.01, 0.3])
    # Every other leg only turns, and one goes straight on.
    made = [TcpPose(rng.normal(size=3) * size, rotation_exp(rng.normal(size=3) * size))]
    for i in range(5):
        step = rng.normal(size=3) * size * (i % 2)
        made.append(TcpPose(made[-1].translation + step, made[-1].rotation @ rotation_exp(rng.normal(size=3) * size)))
    return made


@settings(max_examples=40, deadline=None)
@given(SEEDS)
def test_a_blend_passes_every_waypoint_within_the_tolerance_and_no_leg_is_blended_beyond_its_half(seed: int) -> None:
    points = joints(seed)
    path = joint_path(points, TOLERANCE)
    corners = path.curve().derivatives(path.legs.s)[0]
    assert np.abs(corners - points).max() <= TOLERANCE.joint + 1e-9
    assert (path.legs.radius[:-1] <= np.diff(path.legs.s) / 2 + 1e-12).all()
    assert (path.legs.radius[1:] <= np.diff(path.legs.s) / 2 + 1e-12).all()


def test_a_long_corner_uses_the_whole_tolerance() -> None:
    points = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]])
    path = joint_path(points, TOLERANCE)
    assert np.abs(path.curve().derivatives(path.legs.s[1:2])[0, 0] - points[1]).max() == pytest.approx(TOLERANCE.joint)


@settings(max_examples=40, deadline=None)
@given(SEEDS)
def test_a_joint_curve_is_twice_continuously_differentiable(seed: int) -> None:
    curve = joint_path(joints(seed), TOLERANCE).curve()
    left, right = curve.derivatives(curve.s, left=True), curve.derivatives(curve.s)
    assert np.abs(left[:3] - right[:3]).max() < 1e-6
    s = np.linspace(curve.start, curve.end, 400)[1:-1]
    h = 1e-6
    ahead, behind, here = curve.derivatives(s + h), curve.derivatives(s - h), curve.derivatives(s)
    smooth = np.abs(s[:, None] - curve.s).min(axis=1) > 2 * h
    scale = 1 + np.abs(here[3]).max()
    for order in (0, 1):
        assert np.abs((ahead[order] - behind[order]) / (2 * h) - here[order + 1])[smooth].max() < 1e-4 * scale


@settings(max_examples=25, deadline=None)
@given(SEEDS)
def test_a_task_path_keeps_its_tolerance_and_its_twist_is_its_derivative(seed: int) -> None:
    points = poses(seed)
    path = task_path(points, TOLERANCE)
    for s, point in zip(path.legs.s, points, strict=True):
        step = pose_step(point, path.at(float(s)).pose)
        assert np.linalg.norm(step[:3]) <= TOLERANCE.position + 1e-9
        assert np.linalg.norm(step[3:]) <= TOLERANCE.angle + 1e-9
    h = 1e-6 * path.legs.s[-1]
    for s in np.linspace(0, path.legs.s[-1], 60)[1:-1]:
        ahead, behind, here = path.at(s + h), path.at(s - h), path.at(s)
        linear = (ahead.pose.translation - behind.pose.translation) / (2 * h)
        angular = rotation_log(ahead.pose.rotation @ behind.pose.rotation.T) / (2 * h)
        assert np.abs(np.concatenate([linear, angular]) - here.twist).max() < 1e-3
        accel = (ahead.twist - behind.twist) / (2 * h)
        assert np.abs(accel - here.accel).max() < 1e-3 * (1 + np.abs(here.accel).max()) + 1e-3 / path.legs.s[-1]


def test_without_tolerance_every_corner_is_a_stop_but_a_straight_passage_is_none() -> None:
    path = joint_path(np.array([[0.0, 0], [1, 0], [2, 0], [2, 1]]), Tolerance(0.0, 0.0, 0.0))
    assert path.legs.stop.tolist() == [False, False, True, False]


def test_appending_changes_nothing_before_the_last_corner() -> None:
    first, more = joints(3), joints(4)
    old = joint_path(first, TOLERANCE)
    tail = joint_path(np.vstack([first[-1:], more]), TOLERANCE, float(old.legs.s[-1]))
    new = old.extended(tail, TOLERANCE, free=np.inf)
    corner = old.legs.s.size - 1
    s = np.linspace(0.0, new.legs.s[corner] - new.legs.radius[corner], 100)
    assert np.array_equal(new.curve().derivatives(s)[:3], old.curve().derivatives(s)[:3])
    assert new.legs.radius[corner] > 0


def test_the_corner_of_an_appended_path_is_blended_only_in_what_is_still_free() -> None:
    old = joint_path(np.array([[0.0, 0], [1, 0]]), TOLERANCE)
    tail = joint_path(np.array([[1.0, 0], [1, 1]]), TOLERANCE, 1.0)
    assert old.extended(tail, TOLERANCE, free=0.02).legs.radius[1] == pytest.approx(0.02)
    assert old.extended(tail, TOLERANCE, free=0.0).legs.stop[1]


def test_half_a_turn_has_a_logarithm() -> None:
    for axis in np.eye(3):
        assert np.abs(rotation_exp(rotation_log(rotation_exp(np.pi * axis))) - rotation_exp(np.pi * axis)).max() < 1e-9
